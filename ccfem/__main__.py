"""``python -m ccfem`` is ``ccfem``."""

from ccfem.cli.commands import main

if __name__ == "__main__":
    main()
