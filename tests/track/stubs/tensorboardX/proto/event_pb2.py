"""Events as JSON."""

import json


class SessionLog(dict):
    START = 1

    def __init__(self, status):
        super().__init__(status=status)


class Event(dict):
    def SerializeToString(self):
        return json.dumps(self).encode()
