"""One of everything that conevo writes or reads, and the commands that read it."""

from __future__ import annotations

import shutil
from pathlib import Path

import conevo
from campaigns.plans import tiny_campaign, write_plan
from conevo.campaigns.executors.local import Serial
from conevo.replay.recording import record
from conevo.runs.shaping import start_shaping
from runs.tiny import TASK, evolve_tiny, tiny_settings

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "light.py"
QUICK = "--set run.generations=1 --set run.epochs=1 --set world.iterations=4 --threads 1 --quiet"

RUN = (
    "show run", "show run --json", "test run --scenarios 1 --threads 1", "list runs .",
    "resume run --threads 1", "TRACK run", "replay run --out page.html --threads 1",
    "film run --poster 1 --size 200 --out poster.png --threads 1", "WATCH run",
    "export run --to team.py",
    "resume run --generations 3 --threads 1 --quiet",
)  # fmt: skip
HALF = ("resume half --threads 1 --quiet", "show half", "list runs .", "WATCH half", "TRACK half")
SHAPED = ("show shaped", "resume shaped --threads 1 --quiet", "list runs .", "WATCH shaped",
          "TRACK shaped", "test shaped --stages --scenarios 1 --threads 1")  # fmt: skip
CAMPAIGN = (
    "campaign status tiny", "campaign status tiny --runs", "campaign start tiny --executor serial",
    "campaign retry tiny --executor serial", "campaign slurm tiny --hours 1", "report tiny",
    "WATCH tiny", "TRACK tiny", "query tiny SELECT+1", "campaign list", "campaign stop tiny",
    "campaign start tiny --dry-run",
)  # fmt: skip
READERS: dict[str, tuple[str, ...]] = {
    "run/config.toml": (*RUN, f"run --config run/config.toml --out new {QUICK}"),
    "run/provenance.json": RUN,
    "run/generations.jsonl": RUN,
    "run/test.json": RUN,
    "run/DONE": RUN,
    "run/champion.npz": RUN,
    "run/finalists.npz": RUN,
    "run/teams/generation-0000.npz": (*RUN, "replay run --generation 0 --out page.html"),
    "run/CHECKPOINT": RUN,
    "half/config.toml": HALF,
    "half/provenance.json": HALF,
    "half/generations.jsonl": HALF,
    "half/champion.npz": HALF,
    "half/finalists.npz": HALF,
    "half/CHECKPOINT": HALF,
    "shaped/shaping.toml": SHAPED,
    "shaped/stage-1/config.toml": SHAPED,
    "shaped/stage-1/provenance.json": SHAPED,
    "shaped/stage-2/origin.npz": SHAPED,
    "shaped/generations.jsonl": SHAPED,
    "tiny/plan.toml": CAMPAIGN,
    "tiny/runs.jsonl": CAMPAIGN,
    "tiny/ledger.sqlite": CAMPAIGN,
    "tiny/tables/tables.json": CAMPAIGN,
    "tiny/tables/runs.parquet": CAMPAIGN,
    "tiny/ENDED": CAMPAIGN,
    "tiny/STUDY": ("NOTABLES report tiny", *CAMPAIGN),
    "tiny/SIGNAL": ("NOTABLES report tiny", *CAMPAIGN),
    "tiny/RUN/test.json": ("NOTABLES report tiny", *CAMPAIGN),
    "tiny/RUN/provenance.json": ("NOTABLES report tiny", *CAMPAIGN),
    "tiny/RUN/generations.jsonl": ("NOTABLES report tiny", *CAMPAIGN),
    "tiny/report/manifest.json": ("report tiny",),
    "epoch.npz": ("replay epoch.npz --out page.html", "film epoch.npz --poster 1 --out poster.png"),
    "prey.npz": (f"run pursuit/team-2 --prey prey.npz --preset smoke --out new {QUICK}",),
    "plan.toml": ("campaign start plan.toml --dry-run", "campaign slurm plan.toml --out new"),
    "settings.toml": (f"run --config settings.toml --out new {QUICK}",
                      "run --config settings.toml --dry-run"),
    "light.py": ("run light.py:dark-1 --dry-run",),
}  # fmt: skip


def build(folder: Path) -> None:
    """Write one of everything into a folder."""
    run = evolve_tiny(folder / "run", run__generations=2)
    evolve_tiny(folder / "half", run__generations=2)
    (folder / "half" / "DONE").unlink()
    (folder / "half" / "test.json").unlink()
    settings = tiny_settings("homcne", "rover/complex-2", run__generations=2)
    tasks = [TASK, "rover/complex-2"]
    shaped = start_shaping(tasks, "homcne", "smoke", 1, folder / "shaped", settings, threads=1)
    shaped.resume(threads=1)
    campaign = tiny_campaign(folder, 'studies = ["teams", "signal"]')
    campaign.carry_on(Serial(1))
    report = campaign.paths.report
    report.mkdir()
    (report / "manifest.json").write_text('{"files": {}}')  # as of an empty report
    record(run, threads=1).save(folder / "epoch.npz")
    shipped = Path(conevo.__file__).parent / "worlds" / "pursuit" / "prey-v2.npz"
    shutil.copy(shipped, folder / "prey.npz")
    shutil.copy(write_plan(folder / "plans"), folder / "plan.toml")
    shutil.copy(folder / "run" / "config.toml", folder / "settings.toml")
    shutil.copy(EXAMPLE, folder / "light.py")


def find(folder: Path, name: str) -> Path:
    """Return the file that a name of ``READERS`` stands for."""
    runs = sorted((folder / "tiny" / "runs").iterdir())
    name = name.replace("RUN/", f"runs/{runs[0].name}/") if name.startswith("tiny/") else name
    for short, pattern in (
        ("CHECKPOINT", "checkpoint-?.npz"), ("ENDED", "ended/*.json"), ("STUDY", "studies/*.json"),
        ("SIGNAL", "studies/signal/*.json"),
    ):  # fmt: skip
        if name.endswith(short):
            return sorted(folder.glob(name.replace(short, pattern)))[-1]
    return folder / name
