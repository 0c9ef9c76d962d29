"""The generalised method of wavelet moments. Spec 10."""
