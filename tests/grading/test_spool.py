"""The class's code in a file without a name: what was put there is read again, here and in another process."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.grading.batch.spool import Spool


@given(st.lists(st.binary(max_size=200), max_size=20))
def test_what_was_put_is_read_again_in_any_order_and_by_several_threads(codes: list[bytes]) -> None:
    spool = Spool()
    kept = [spool.put(code) for code in codes]
    del spool  # what is held keeps the file
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(lambda each: each.read(), reversed(kept))) == codes[::-1]
    assert [each.size for each in kept] == [len(code) for code in codes]


def test_it_travels_with_its_bytes() -> None:
    kept = Spool().put(b"first"), Spool().put(b"law = 1")
    travelled = pickle.loads(pickle.dumps(kept[1]))
    assert travelled.read() == b"law = 1" and travelled.file is None


def test_no_room_is_told_with_the_place(monkeypatch: pytest.MonkeyPatch) -> None:
    spool = Spool()
    with open("/dev/full", "r+b", buffering=0) as full:
        monkeypatch.setattr(spool, "_file", full)
        with pytest.raises(InputError, match="No space left on device; make room there"):
            spool.put(b"law")
