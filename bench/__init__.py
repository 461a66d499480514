"""The bench: clients of rig and module, procedures, calibration, acceptance, record."""
