"""What is in a log beside the noise of its sensor: lines, knocks, outliers, temperature."""
