"""A sample of the mutants of ``make fuzz``."""

import pytest

from ocp_traj.proof.verdicts import Audit
from tests import fuzz


@pytest.mark.slow
def test_what_is_proved_of_mutated_files_holds_and_nothing_ends_in_a_traceback() -> None:
    found = fuzz.main(30, 2, heavy=False)
    assert not found.faults
    assert found.audited >= 10 and found.outcomes[fuzz.PROVED] >= 4 and found.outcomes[fuzz.REFUSED] >= 4


@pytest.mark.slow
def test_proofs_that_are_false_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """An audit that calls everything proved."""
    monkeypatch.setattr(Audit, "proved", True)
    found = fuzz.main(12, 0, heavy=False, say=lambda words: None)
    assert any("FALSE PROOF" in fault for fault in found.faults)


@pytest.mark.slow
def test_a_mutant_follows_from_seed_and_index() -> None:
    said: list[str] = []
    for _ in range(2):
        fuzz.main(0, 4, only=7, heavy=False, say=said.append)
    assert said[0] == said[1]
