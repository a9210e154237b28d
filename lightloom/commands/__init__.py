"""One module a command: its options and help, its output; the work itself is done elsewhere.

Modules here import little at the top, so that `lightloom --help` is quick; what a command needs it imports when called.
"""
