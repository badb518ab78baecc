"""`python -m dsd_cli` is `dsd`."""

from dsd_cli.cli.main import main

if __name__ == "__main__":
    main()
