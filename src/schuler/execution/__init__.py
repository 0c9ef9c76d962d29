"""Work that takes long: who does it, what is kept of it, what to show while it runs."""
