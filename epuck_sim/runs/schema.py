"""The tables of a run folder's database, their versions, and queries that belong to them."""

from epuck_sim.runs.checksums import CHECKSUM

DATABASE = "results.sqlite"
"""Name of the file in a run folder that holds a row for each trial."""

STORED = ".stored"
"""Name of the file in a run folder that says how many trials a run has stored, until its log is in the database."""

APPLICATION_ID = int.from_bytes(b"epck")
"""Marks a SQLite file as ours (its header, bytes 68 to 71)."""

FORMAT = 2
"""Version of the tables (bytes 60 to 63); the first had no checksums, and is read, too."""

RESULT = ("t_sync_cycles", "censored", "order_parameter", "simulated_s", "wall_s", "steps", "cycles")
"""Columns that hold fields of a TrialResult."""

POINTS = """
CREATE TABLE points (
    key TEXT PRIMARY KEY, -- the axis values as text
    number INTEGER NOT NULL, -- its place in the sweep
    trials INTEGER NOT NULL, -- how many there are to be
    axes TEXT NOT NULL, -- JSON: value by dotted key
    scenario TEXT NOT NULL, -- JSON: everything that its trials depend on
    controllers TEXT NOT NULL -- JSON: each group's controller, and the digest of a user's file
) WITHOUT ROWID
"""

TRIALS = """
CREATE TABLE trials (
    point TEXT NOT NULL REFERENCES points (key), trial INTEGER NOT NULL, {axes}
    seed INTEGER NOT NULL, t_sync_cycles INTEGER, censored INTEGER, order_parameter REAL, simulated_s REAL, wall_s REAL,
    steps INTEGER, cycles INTEGER, {provenance}, error TEXT, -- of a trial that failed; it has no result then
    PRIMARY KEY (point, trial)
) WITHOUT ROWID
"""

LATER_COLUMNS = {
    "points": {
        "measures": "TEXT NOT NULL DEFAULT '{}'",  # JSON: see `compatibility.StoredPoint.measures`
        "share": "TEXT",  # the share of the sweep that the folder is for, the same in all rows; NULL for the whole
        CHECKSUM: "INTEGER",
    },
    "trials": {
        CHECKSUM: "INTEGER",
        "measured": "TEXT",  # JSON: value of each measure by its name; NULL without measures
        "events": "TEXT",  # JSON: what changed in the trial, see `scenario.schedule.TrialEvent`; NULL if nothing did
        "measuring_error": "TEXT",  # why a stored trial could not be measured again for new measures; NULL if it could
    },
}
"""Columns of each table that earlier folders do not have, and their types."""

UNMEASURED = """
    EXISTS (SELECT 1 FROM json_each(measures) AS one WHERE json_type(measured, '$."' || one.key || '"') IS NULL)
"""
"""Condition on a trial, joined with its point: it lacks the value of a measure."""

LOST_POINT = """
    WITH RECURSIVE found (key) AS (
        SELECT min(point) FROM trials
        UNION ALL SELECT (SELECT min(point) FROM trials WHERE point > key) FROM found WHERE key IS NOT NULL
    )
    SELECT key FROM found WHERE key IS NOT NULL AND key NOT IN (SELECT key FROM points)
"""
"""Query for points that trials have, but the table of points has not; it looks at one trial of each point."""

ENTER_POINT = (
    "INSERT INTO points (key, number, trials, axes, scenario, controllers, measures, share) "
    "VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (key) DO UPDATE SET number = excluded.number, "
    "trials = excluded.trials, scenario = excluded.scenario, measures = excluded.measures, share = excluded.share"
)
