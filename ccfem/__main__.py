"""``python -m ccfem`` is ``ccfem``."""

from ccfem.cli.start import start

if __name__ == "__main__":
    start()
