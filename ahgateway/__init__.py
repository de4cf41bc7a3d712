"""ahgateway: a hardware-in-the-loop gateway to Delta AH500 PID loops."""

__version__ = "0.1.0"
