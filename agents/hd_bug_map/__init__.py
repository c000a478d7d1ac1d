"""HD-BUG: the policy and its parts."""
