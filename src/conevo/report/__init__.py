"""The report of a campaign: verdicts on claims, statistics, tables and figures."""
