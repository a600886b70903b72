"""A Dask cluster gives the front of one process, by plain and by encrypted addresses; what is no cluster is said so."""

from collections.abc import Iterator

import dask
import numpy as np
import pytest
from distributed import LocalCluster
from distributed.security import Security

import ocp_traj as ot
from ocp_traj.errors import InputError
from ocp_traj.parallel.cluster import Cluster
from ocp_traj.solvers.front_tracer import FrontTracer
from tests.test_workers import quintic

PAIR = ["time", "effort"]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("default"),  # Dask's own, of ports and of loops that are closed
]


@pytest.fixture
def encrypted() -> Iterator[Security]:
    """Certificates for an hour, which Dask's configuration names."""
    security = Security.temporary()
    told = {role: security.get_tls_config_for_role(role) for role in ("client", "scheduler", "worker")}
    settings = {
        f"distributed.comm.tls.{role}.{name}": one[name] for role, one in told.items() for name in ("key", "cert")
    }
    settings |= {"distributed.comm.tls.ca-file": told["client"]["ca_file"], "distributed.comm.require-encryption": True}
    with dask.config.set(settings):
        yield security


def test_a_cluster_of_two_processes_finds_the_same_bytes() -> None:
    front = FrontTracer(points=7).pareto(quintic(), PAIR)
    with LocalCluster(n_workers=2, threads_per_worker=2, dashboard_address=None) as cluster:
        with Cluster(cluster.scheduler_address) as hands:
            assert hands.count == 2
            found = FrontTracer(points=7, workers=hands).pareto(quintic(), PAIR)
    assert np.array_equal(found.xs, front.xs)


def test_an_encrypted_address_takes_its_certificates_from_dasks_configuration(
    encrypted: Security, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scheduler answers: that it has no worker is known of one that was reached."""
    monkeypatch.setattr("ocp_traj.parallel.cluster.TIMEOUT", 5.0)
    with LocalCluster(
        n_workers=0, processes=False, protocol="tls", security=encrypted, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        assert cluster.scheduler_address.startswith("tls://")
        with pytest.raises(InputError, match="has no worker; begin one: dask worker"):
            Cluster(cluster.scheduler_address)


def test_what_is_no_cluster_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ocp_traj.parallel.cluster.TIMEOUT", 0.5)
    for address in ("tcp://127.0.0.1:1", "nonsense://a", ""):
        with pytest.raises(InputError, match="there is no Dask scheduler at"):
            ot.pareto(quintic(), PAIR, cluster=address)
    with LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster:
        with pytest.raises(InputError, match="has no worker; begin one: dask worker"):
            Cluster(cluster.scheduler_address)
