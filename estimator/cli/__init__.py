"""The command ``estimator``; a subcommand is a function whose signature declares its options."""
