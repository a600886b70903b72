"""What a problem says: variables, objectives, limits, scalarisations; the registry of problems."""
