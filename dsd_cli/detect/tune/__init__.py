"""The detector's tuning from a log: noise and dwell times are fitted, then what labels best."""
