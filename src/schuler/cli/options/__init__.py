"""Options that several verbs share, each group a dataclass."""
