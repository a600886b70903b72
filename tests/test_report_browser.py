"""The page in Chromium, opened from the disk with the network off: what is chosen is shown, and where it says."""

import shutil
import time
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pytest import approx

from ocp_traj import problems
from ocp_traj.arrays import Array
from ocp_traj.io.store import save_run
from ocp_traj.report.page import write_page
from ocp_traj.report.sources import source_of_front
from ocp_traj.results.front import Front
from ocp_traj.robot.placements import placements_function
from tests.report_gantry import build

pytestmark = pytest.mark.browser

CHROMIUM = next((p for p in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if p), None)
DRIVER = shutil.which("chromedriver")
WIDE, NARROW = 1400, 400
SHARES = (0.0, 0.21, 0.5, 0.83, 1.0)  # of a trajectory's duration
FRAME = 1.0 / 15.0  # [s] that drawing an instant may take


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("not run: there is no chromium, or no chromedriver (on Debian: chromium, chromium-driver)")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    profile = tmp_path_factory.mktemp("chromium")
    for word in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", f"--user-data-dir={profile}"):
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(options=options, service=Service(DRIVER))
    try:
        browser.set_script_timeout(120)
        browser.execute_cdp_cmd("Network.enable", {})
        offline = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
        browser.execute_cdp_cmd("Network.emulateNetworkConditions", offline)
        yield browser
    finally:
        browser.quit()


def bent(problem: Any, durations: Any, objectives: list[str]) -> Front:
    """Five motions, each slower than the last and of another shape."""
    h, places = np.array(durations, dtype=float), np.arange(len(durations))
    xs = [factor * h * (1.0 + 0.03 * np.sin(k + places)) for k, factor in enumerate((1.0, 1.2, 1.4, 1.7, 2.0))]
    front = Front.of(problem, objectives, xs, method="bent", seed=None, seconds=0.0, keep_unproved=True)
    assert len(front) == 5
    return front


@pytest.fixture(scope="module")
def hybrid_front() -> Front:
    problem = problems.load("hybrid-spline")
    return bent(problem, problems.module("hybrid-spline").TABLE_7, ["time", "energy"])


@pytest.fixture(scope="module")
def gantry_front() -> Front:
    return bent(build(), [1.5, 1.8, 1.8, 1.5], ["time", "jerk"])


@pytest.fixture(scope="module")
def threefold() -> Front:
    """A front of three objectives."""
    problem = problems.load("hybrid-spline")
    return bent(problem, problems.module("hybrid-spline").TABLE_7, ["time", "energy", "jerk"])


def settled(driver: Any) -> None:
    """Waits until all that was asked for is drawn."""
    words = driver.execute_async_script(
        "const done = arguments[0]; ocp.parts.main.state.settled.then(() => done(''), (e) => done(String(e.stack)))"
    )
    assert words == ""


def opened(driver: Any, path: Path, width: int = WIDE, dark: bool = False) -> None:
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
    driver.get_log("browser")  # those of the last page
    driver.get(path.as_uri())
    settled(driver)


def faults(driver: Any) -> list[str]:
    return [entry["message"] for entry in driver.get_log("browser") if entry["level"] == "SEVERE"]


@pytest.fixture(scope="module")
def pages(
    hybrid_front: Front, gantry_front: Front, threefold: Front, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    sources = {
        "hybrid": [source_of_front(hybrid_front, "hybrid")],
        "gantry": [source_of_front(gantry_front, "gantry")],
        "both": [source_of_front(gantry_front, "gantry"), source_of_front(hybrid_front, "hybrid")],
        "threefold": [source_of_front(threefold, "threefold"), source_of_front(hybrid_front, "hybrid")],
    }
    return {name: write_page(given, folder / f"{name}.html") for name, given in sources.items()}


@pytest.mark.parametrize("name", ["hybrid", "gantry", "both", "threefold"])
@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_it_opens_offline_without_a_fault_and_fits(driver: Any, pages: dict[str, Path], name: str, width: int) -> None:
    opened(driver, pages[name], width, dark=width == NARROW)
    assert faults(driver) == []
    entries = driver.execute_script("return performance.getEntriesByType('resource').map((e) => e.name)")
    assert [entry for entry in entries if not entry.startswith(("data:", "blob:"))] == []
    assert driver.execute_script("return document.documentElement.scrollWidth") <= width
    cut = driver.execute_script(
        "return [...document.querySelectorAll('h1, h2, h3, p, button, dd, dt, label')].filter((e) => e.offsetParent && "
        "e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).display !== 'inline').map((e) => e.textContent)"
    )
    assert cut == []


def shown(driver: Any) -> dict[str, Any]:
    """What the page shows of the point that is chosen."""
    found = driver.execute_script("""
      const { state, panels, scene } = ocp.parts.main;
      const text = (id) => document.getElementById(id).innerText;
      const chosen = document.getElementById("front").data.filter((t) => t.name === "chosen");
      return { set: state.set, point: state.point, curves: panels.panels.map((p) => p.plot.data[0].y),
        margins: text("margins"), variables: text("variables"), now: text("now"), frames: scene().frames,
        picture: document.getElementById("robot").toDataURL(), ring: chosen.map((t) => [t.x[0], t.y[0]]) };
    """)  # fmt: skip
    return dict(found)


def differ(first: dict[str, Any], second: dict[str, Any]) -> None:
    for name in ("curves", "margins", "variables", "now", "frames", "picture", "ring"):
        assert first[name] != second[name], name


def test_keys_choose_points_and_everything_follows(driver: Any, pages: dict[str, Path], gantry_front: Front) -> None:
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    opened(driver, pages["gantry"])
    driver.execute_script("ocp.parts.main.player.to(2.0)")
    body = driver.find_element(By.TAG_NAME, "body")
    states = []
    for key in (Keys.HOME, Keys.ARROW_RIGHT, Keys.END):
        body.send_keys(key)
        settled(driver)
        states.append(shown(driver))
    assert [state["point"] for state in states] == [0, 1, 4]
    assert [state["ring"][0] for state in states] == [approx(gantry_front.values[i].tolist()) for i in (0, 1, 4)]
    differ(states[0], states[1])
    differ(states[1], states[2])
    body.send_keys("k")
    assert driver.execute_script("return ocp.parts.main.state.point") == gantry_front.knee()
    assert faults(driver) == []


def test_a_click_chooses_a_point(driver: Any, pages: dict[str, Path]) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    opened(driver, pages["hybrid"])
    driver.execute_script("ocp.parts.main.player.to(2.0)")
    before = shown(driver)
    chosen = 3 if before["point"] != 3 else 2
    plot = driver.find_element(By.ID, "front")
    x, y = driver.execute_script(
        "const g = arguments[0], l = g._fullLayout, t = g.data[0], i = arguments[1], box = g.getBoundingClientRect();"
        "const at = (axis, value) => axis._offset + axis.d2p(value);"
        "return [at(l.xaxis, t.x[i]) - box.width / 2, at(l.yaxis, t.y[i]) - box.height / 2]",
        plot, chosen,
    )  # fmt: skip
    ActionChains(driver).move_to_element_with_offset(plot, round(x), round(y)).pause(0.2).click().perform()
    settled(driver)
    after = shown(driver)
    assert after["point"] == chosen
    differ(before, after)


def exact_places(front: Front, index: int, time: float) -> Array:
    """Places of all joints and of the tool ``(joints + 1, 3)``, by the package's own kinematics."""
    problem, trajectory = front.problem, front.trajectory(index)
    q = trajectory.curve(np.array([time]))[0]
    joints = range(1, problem.robot.model.njoints)
    found = np.array(placements_function(problem.robot, list(joints))(q)).reshape(-1, 12)[:, 9:]
    return np.vstack([found, problem.robot.poses(q)[1]])


@pytest.mark.parametrize("name", ["hybrid", "gantry"])
def test_the_slider_moves_every_joint_to_its_place(
    driver: Any, pages: dict[str, Path], name: str, request: pytest.FixtureRequest
) -> None:
    front: Front = request.getfixturevalue(f"{name}_front")
    opened(driver, pages[name])
    worst, pictures = 0.0, set()
    for index in (0, 2, 4):
        driver.execute_script("return ocp.parts.main.choose(0, arguments[0])", index)
        for share in SHARES:
            driver.execute_script(
                "const s = document.getElementById('time'); s.value = arguments[0];s.dispatchEvent(new Event('input'))",
                share,
            )
            drawn = np.array(driver.execute_script("return ocp.parts.main.scene().frames"))[1:, 9:]
            wanted = exact_places(front, index, share * front.trajectory(index).duration)
            worst = max(worst, float(np.abs(drawn - wanted).max()))
            pictures.add(driver.execute_script("return document.getElementById('robot').toDataURL()"))
    assert worst <= 1e-6
    assert worst <= 1e-12  # what rounding leaves
    assert len(pictures) >= 3 * (len(SHARES) - 2)  # begin and end are the same for all


def test_curves_in_the_page_are_those_of_the_package(driver: Any, pages: dict[str, Path], gantry_front: Front) -> None:
    opened(driver, pages["gantry"])
    curve = gantry_front.trajectory(1).curve
    times = np.linspace(0.0, curve.duration, 9)
    for order in range(5):
        found = driver.execute_script(
            "const s = ocp.data.sets[0]; const c = new ocp.parts.curve.Curve(s.points[1], s.joints.length);"
            "return arguments[0].map((t) => Array.from(c.at(t, arguments[1])))",
            times.tolist(), order,
        )  # fmt: skip
        exact = curve(times, order)
        assert np.abs(np.array(found) - exact).max() <= 1e-9 * (1.0 + np.abs(exact).max())


def test_an_instant_is_drawn_fifteen_times_a_second(driver: Any, pages: dict[str, Path]) -> None:
    opened(driver, pages["gantry"])
    spent = driver.execute_script("""
      const { player } = ocp.parts.main;
      const found = Array.from({ length: 60 }, (_, i) => {
        const begun = performance.now();
        player.to(0.1 * i);
        return performance.now() - begun;
      });
      return found.sort((a, b) => a - b)[30] / 1000;
    """)  # fmt: skip
    assert spent <= FRAME
    driver.execute_script("document.getElementById('play').click()")
    time.sleep(0.6)
    assert driver.execute_script("return ocp.parts.main.player.time") > 0.0
    driver.execute_script("document.getElementById('play').click()")
    at = driver.execute_script("return ocp.parts.main.player.time")
    time.sleep(0.2)
    assert driver.execute_script("return ocp.parts.main.player.time") == at


def test_the_download_holds_the_table(driver: Any, pages: dict[str, Path], hybrid_front: Front, tmp_path: Path) -> None:
    opened(driver, pages["hybrid"])
    allowed = {"behavior": "allow", "downloadPath": str(tmp_path)}
    driver.execute_cdp_cmd("Browser.setDownloadBehavior", allowed)
    tables = {}
    for button, name in (("table-csv", "hybrid.csv"), ("margins-csv", "hybrid-2-margins.csv")):
        driver.execute_script("return ocp.parts.main.choose(0, 2)")
        driver.execute_script("document.getElementById(arguments[0]).click()", button)
        for _ in range(100):
            if (tmp_path / name).exists():
                break
            time.sleep(0.1)
        tables[button] = pd.read_csv(tmp_path / name)
    save_run(hybrid_front, tmp_path / "run")
    own = pd.read_csv(StringIO(hybrid_front.full_table.to_csv()))
    pd.testing.assert_frame_equal(tables["table-csv"][list(own.columns)], own, check_exact=True)
    rows = source_of_front(hybrid_front, "hybrid").points[2].audit.rows
    margins = tables["margins-csv"]
    assert margins["attained"].tolist() == [row.attained for row in rows]
    assert margins["verdict"].tolist() == [row.verdict for row in rows]


def test_another_run_brings_another_robot(driver: Any, pages: dict[str, Path]) -> None:
    from selenium.webdriver.common.by import By

    opened(driver, pages["both"])
    first = shown(driver)
    driver.find_element(By.TAG_NAME, "body").send_keys("]")
    settled(driver)
    second = shown(driver)
    assert (first["set"], second["set"]) == (0, 1)
    assert (len(first["frames"]), len(second["frames"])) == (6, 7)
    assert "not drawn here" in driver.find_element(By.ID, "front-note").text.lower()  # its jerk has another unit
    assert faults(driver) == []


def test_three_objectives_are_shown_three_ways(driver: Any, pages: dict[str, Path], threefold: Front) -> None:
    opened(driver, pages["threefold"])
    kinds = driver.execute_script(
        "return [...document.querySelectorAll('#front-views button')].map((b) => b.textContent)"
    )
    assert kinds[:2] == ["parallel coordinates", "3-D"] and len(kinds) == 5
    for kind in kinds:
        driver.execute_script(
            "[...document.querySelectorAll('#front-views button')].find((b) => b.textContent === arguments[0]).click()",
            kind,
        )
        settled(driver)
        points = driver.execute_script(
            "const t = document.getElementById('front').data.filter((t) => t.customdata && t.customdata.length > 1);"
            "return Math.max(t.length, ...t.map((one) => one.x.length))"
        )
        assert points >= len(threefold)
    assert faults(driver) == []


def test_it_is_dark_or_light_as_is_preferred_and_asked(driver: Any, pages: dict[str, Path]) -> None:
    paper = "return getComputedStyle(document.body).backgroundColor"
    opened(driver, pages["gantry"], dark=True)
    dark = driver.execute_script(paper)
    opened(driver, pages["gantry"], dark=False)
    light = driver.execute_script(paper)
    assert (dark, light) == ("rgb(20, 23, 26)", "rgb(255, 255, 255)")
    driver.execute_script("document.getElementById('theme').click()")
    assert driver.execute_script(paper) == dark
