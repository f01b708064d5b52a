"""The parts of a report: each module turns one group of runs into text, tables and figures."""
