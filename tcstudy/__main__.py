"""`python -m tcstudy` is the command line."""

from tcstudy.cli import main

raise SystemExit(main())
