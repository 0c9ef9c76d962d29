"""Files in: `read_imu`, `read_gnss` and `read_sensor`, and behind them one reader per format."""

from schuler.io.read import read_gnss, read_imu, read_imus, read_sensor

__all__ = ["read_gnss", "read_imu", "read_imus", "read_sensor"]
