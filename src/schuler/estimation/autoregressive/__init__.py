"""Autoregressive models: Yule-Walker, covariance, modified covariance and Burg. Spec 3."""
