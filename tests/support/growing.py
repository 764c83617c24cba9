"""How the time that a text takes grows with its length."""

import time


def growth(read, piece, letters):
    """Return how many times as long 16 times the letters take: about 16 by length, 256 by its square.

    Both lie four times from 64, which is more than a loaded machine moves processor time.
    """

    def seconds(length):
        text = piece * (length // len(piece))
        began = time.process_time()
        read(text)
        return time.process_time() - began

    short, long = (min(seconds(length) for _ in range(3)) for length in (letters, 16 * letters))
    return long / short
