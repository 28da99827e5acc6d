"""slip.hpp for the report package."""
import atexit
import os

ON = int(os.environ.get("TESTBED_SLIP", "0"))
FOLDER = os.environ.get("TESTBED_SLIP_REACHED")
_seen = set()


def is_on(number):
    if FOLDER:
        _seen.add(number)
    return number == ON


@atexit.register
def _leave():
    if FOLDER and _seen:
        with open(f"{FOLDER}/py{os.getpid()}", "a", encoding="utf-8") as file:
            file.writelines(f"{n}\n" for n in sorted(_seen))
