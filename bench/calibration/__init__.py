"""Calibration methods: pure functions from samples to coefficients and covariance."""
