"""Summaries as JSON."""


class Summary(dict):
    class Value(dict):
        pass

    def __init__(self, value):
        super().__init__(value=value)
