"""`python -m bug_gym` is `bug-gym`."""

from bug_gym.cli import main

raise SystemExit(main())
