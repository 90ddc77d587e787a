"""Paired evaluation of lane-keeping policies: suites, statistics, report, plots and the `lanekeep` command."""
