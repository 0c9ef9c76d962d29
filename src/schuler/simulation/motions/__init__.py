"""How bodies move: cars, motorcycles, skis, drones, people on foot, recorded tracks."""
