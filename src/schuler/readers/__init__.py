"""Files in: one door, `read_imu` and `read_gnss`, and behind it one reader per format."""

from schuler.readers.door import read_gnss, read_imu, read_imus

__all__ = ["read_gnss", "read_imu", "read_imus"]
