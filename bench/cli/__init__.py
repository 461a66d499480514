"""The command line: the one place that joins bench, devices and dashboards."""
