"""Signals that a script ignores for its background jobs reach the tools that these tests start."""
import signal

for number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(number) == signal.SIG_IGN:
        # Programs inherit what is ignored, but no handler: these tests go on, and a tool starts with the default.
        signal.signal(number, lambda *_: None)
