"""Tables of named columns: text, Parquet, NumPy archives, JSON lines."""
