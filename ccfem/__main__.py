"""``python -m ccfem`` is ``ccfem``."""

from ccfem.cli import main

if __name__ == "__main__":
    main()
