"""``python -m qpavoid`` is ``qpavoid``."""

from qpavoid.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
