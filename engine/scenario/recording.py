"""How a recorded mission's files map to sensors: columns, units and conventions, in TOML, no code."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StringConstraints, model_validator

from engine.scenario.errors import Problem
from engine.scenario.models import Name, Point, Positive, Table, faults

#: A folder's or file's own name: no path, nothing hidden. "." is the scenario file's own folder.
FolderName = Annotated[str, StringConstraints(pattern=r"^(\.|[A-Za-z0-9][A-Za-z0-9_.-]{0,99})$")]
FileName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,99}\.(csv|tsv|txt|pyfg|fg)$")]
#: A file of samples.
SoundName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,99}\.(wav|npy|txt)$")]
Column = Annotated[str, StringConstraints(min_length=1, max_length=200)]
Unit = Literal["s", "ms", "us", "ns"]
AngleUnit = Literal["rad", "deg"]
File = Annotated[FileName, Field(description="name of the CSV file in the log's folder")]
Time = Annotated[Column, Field(description="column of the time")]
TimeUnit = Annotated[Unit, Field(description="unit of the time column")]
Convention = Annotated[
    Literal["math", "compass"],
    Field(description="math: counter-clockwise from x (east); compass: clockwise from y (north)"),
]


class Simulated(Table):
    """The mission is simulated from the vehicles' paths and sensors."""

    kind: Literal["simulated"]


class OdometryFile(Table):
    """Pose increments since the previous row: forward, to the left where there is such a column, and turn."""

    vehicle: str = Field(description="vehicle it is of")
    file: File
    time: Time
    time_unit: TimeUnit = "s"
    forward: Column = Field(description="column of the metres forward")
    left: Column | None = Field(None, description="column of the metres to the left")
    turn: Column = Field(description="column of the turn")
    turn_unit: AngleUnit = Field("rad", description="unit of the turn")
    turn_positive: Literal["left", "right"] = Field("left", description="direction of a positive turn")
    cov: Annotated[list[Column], Field(min_length=6, max_length=6)] | None = Field(
        None,
        description="columns of each increment's covariance (m, m, rad): upper triangle by rows; "
        "without them the noise is the vehicle's odometry sensor's",
    )


class VelocityFile(Table):
    """Velocities over ground: in the body frame (forward, left or right), or in the world frame (east, north)."""

    vehicle: str = Field(description="vehicle it is of")
    file: File
    time: Time
    time_unit: TimeUnit = "s"
    forward: Column | None = Field(None, description="column of the body velocity forward, m/s")
    left: Column | None = Field(None, description="column of the body velocity to the left, m/s")
    right: Column | None = Field(None, description="column of the body velocity to the right, m/s, instead of left")
    east: Column | None = Field(None, description="column of the world velocity along x, m/s")
    north: Column | None = Field(None, description="column of the world velocity along y, m/s")

    @property
    def world(self) -> bool:
        """Whether the velocities are in the world frame."""
        return self.east is not None

    @model_validator(mode="after")
    def _one_frame(self) -> VelocityFile:
        body = self.forward is not None and (self.left is None or self.right is None)
        extra = self.left is not None or self.right is not None
        world = self.east is not None and self.north is not None
        if world == body or (world and extra) or (body and (self.east is not None or self.north is not None)):
            raise faults(
                [Problem("forward", "no single frame is named", "give forward and left (or right), or east and north")]
            )
        return self


class HeadingFile(Table):
    """Absolute headings."""

    vehicle: str = Field(description="vehicle it is of")
    file: File
    time: Time
    time_unit: TimeUnit = "s"
    heading: Column = Field(description="column of the heading")
    unit: AngleUnit = Field("rad", description="unit of the heading")
    convention: Convention = "math"


class DepthFile(Table):
    """Depths."""

    vehicle: str = Field(description="vehicle it is of")
    file: File
    time: Time
    time_unit: TimeUnit = "s"
    depth: Column = Field(description="column of the depth, m")
    positive: Literal["down", "up"] = Field("down", description="direction of positive numbers")


class FixesFile(Table):
    """Absolute positions (GPS)."""

    vehicle: str = Field(description="vehicle it is of")
    file: File
    time: Time
    time_unit: TimeUnit = "s"
    x: Column = Field(description="column of the position east, m")
    y: Column = Field(description="column of the position north, m")
    cov: Annotated[list[Column], Field(min_length=3, max_length=3)] | None = Field(
        None, description="columns of xx, xy, yy of each fix's covariance, m^2; without them the GPS's sigma counts"
    )


class RangesFile(Table):
    """Ranges, or travel times, of one broadcast to one receiver a row.

    Sender and receiver are a vehicle's name, or a column of them; `names` translates what stands in the column.
    The time is that of arrival. Rows that share a number in the `broadcast` column are one broadcast; without
    that column each row is a broadcast of its own, launched a travel time before it arrived.
    """

    file: File
    time: Time
    time_unit: TimeUnit = "s"
    sender: str | None = Field(None, description="vehicle that sends")
    sender_column: Column | None = Field(None, description="column of who sends, instead")
    receiver: str | None = Field(None, description="vehicle that measures the range")
    receiver_column: Column | None = Field(None, description="column of who measures, instead")
    range: Column | None = Field(None, description="column of the range, m")
    travel_time: Column | None = Field(None, description="column of the one-way travel time, instead")
    travel_time_unit: Unit = Field("s", description="unit of the travel time")
    tol: Column | None = Field(None, description="column of the time of launch, in the unit of the time column")
    broadcast: Column | None = Field(None, description="column of the number of the broadcast")
    names: dict[str, str] = Field({}, description="what stands in the columns -> name of the vehicle")
    ignore: list[str] = Field([], description="what to pass over in the sender and receiver columns")
    sort: bool = Field(False, description="put the rows in order of time; without it, an unsorted file is an error")

    @model_validator(mode="after")
    def _complete(self) -> RangesFile:
        problems = [
            Problem(end, "is not said, or said twice", f"give either {end} or {end}_column")
            for end, name, column in (
                ("sender", self.sender, self.sender_column),
                ("receiver", self.receiver, self.receiver_column),
            )
            if (name is None) == (column is None)
        ]
        if (self.range is None) == (self.travel_time is None):
            problems.append(Problem("range", "is not said, or said twice", "give either range or travel_time"))
        if self.broadcast and not self.tol:
            problems.append(Problem("tol", "is missing", "say when a numbered broadcast was launched"))
        if problems:
            raise faults(problems)
        return self


class NodesFile(Table):
    """Positions of fixed nodes, one a row."""

    file: File
    name: Column = Field(description="column that names the node")
    x: Column = Field(description="column of the position east, m")
    y: Column = Field(description="column of the position north, m")
    names: dict[str, str] = Field({}, description="what stands in the column -> name of the vehicle")


class TruthFile(Table):
    """Positions to score against, interpolated between rows."""

    vehicle: str = Field(description="vehicle it is of")
    file: File
    time: Time
    time_unit: TimeUnit = "s"
    x: Column = Field(description="column of the position east, m")
    y: Column = Field(description="column of the position north, m")
    heading: Column | None = Field(None, description="column of the heading, for the start")
    heading_unit: AngleUnit = Field("rad", description="unit of the heading")
    convention: Convention = "math"
    max_gap_s: Positive = Field(10.0, description="longest gap to interpolate over, s")


class CsvRecording(Table):
    """A log kept as CSV files in one folder, every file with a header line."""

    kind: Literal["recorded"]
    format: Literal["csv"]
    log: FolderName = Field(description='name of the folder; "." is the scenario file\'s own')
    start_s: float | None = Field(
        None, description="time in the log, s, that is time zero of the mission; without it the earliest reading's"
    )
    odometry: list[OdometryFile] = Field([], max_length=64)
    velocity: list[VelocityFile] = Field([], max_length=64)
    heading: list[HeadingFile] = Field([], max_length=64)
    depth: list[DepthFile] = Field([], max_length=64)
    fixes: list[FixesFile] = Field([], max_length=64)
    ranges: list[RangesFile] = Field([], max_length=64)
    nodes: list[NodesFile] = Field([], max_length=64)
    truth: list[TruthFile] = Field([], max_length=64)


class PyfgRecording(Table):
    """A log in PyFG, the text format of range-aided SLAM.

    Every range is a broadcast heard by the first key of its EDGE_RANGE. A point (VERTEX_XY) with a prior is a
    position fix of the moving beacon at the time of its range; one without is a fixed node.
    """

    kind: Literal["recorded"]
    format: Literal["pyfg"]
    log: FolderName = Field(description='name of the folder; "." is the scenario file\'s own')
    file: FileName = Field(description="name of the file in the folder")
    robots: dict[str, str] = Field(description="first letter of a pose's key -> name of the vehicle")
    nodes: dict[str, str] = Field({}, description="key of a point -> name of the fixed vehicle there")
    moving_beacon: str | None = Field(None, description="vehicle whose fixes are the points with a prior")
    odometry_cov_scale: Positive = Field(
        1.0, description="multiplies the file's odometry covariances, where the vehicle states no odometry noise"
    )
    landmarks: Literal["off"] | list[str] = Field(
        "off", description="vehicles that take sightings of landmarks, two or more at once, as position fixes"
    )
    reference: Literal["independent", "own_navigation", "none"] = Field(
        "independent",
        description="what the file's poses are: a truth, the vehicle's own navigation, or nothing to score by",
    )
    max_gap_s: Positive = Field(10.0, description="longest gap between poses to interpolate the reference over, s")


class SonarRecording(Table):
    """Hydrophone records of a beacon's transmissions, and a CSV file with a row for each of them in order of time.

    Records are a WAV file, or a .npy array or text column of samples, cut at the `start` of each row (its time where
    there is no such column); or a .npy array with one record a row. Every transmission is a pose of the vehicle.
    """

    kind: Literal["recorded"]
    format: Literal["sonar"]
    log: FolderName = Field(description='name of the folder; "." is the scenario file\'s own')
    vehicle: Name = Field("auv", description="who recorded")
    beacon: Name = Field("beacon", description="who transmitted")
    records: SoundName = Field(description="file of the records")
    channel: int = Field(0, ge=0, le=1000, description="channel of a WAV file to use, from 0")
    chirp: SoundName | None = Field(None, description="file of the transmitted waveform; without it sonar's chirp")
    pings: File
    time: Time
    time_unit: TimeUnit = "s"
    start: Column | None = Field(None, description="column of when a transmission is in the file of the records, s")
    x: Column = Field(description="column of the dead-reckoned position east, m")
    y: Column = Field(description="column of the dead-reckoned position north, m")
    fix_x: Column | None = Field(None, description="column of position fixes east, m; empty where there is none")
    fix_y: Column | None = Field(None, description="column of position fixes north, m; empty where there is none")
    truth_x: Column | None = Field(None, description="column of the vehicle's true position east, m, to score by")
    truth_y: Column | None = Field(None, description="column of the vehicle's true position north, m, to score by")
    beacon_m: Point | None = Field(None, description="the beacon's true position [x, y], m, to score by")

    @model_validator(mode="after")
    def _pairs(self) -> SonarRecording:
        for x, y in (("fix_x", "fix_y"), ("truth_x", "truth_y")):
            if (getattr(self, x) is None) != (getattr(self, y) is None):
                raise faults([Problem(x, f"goes with {y}", "name both columns, or neither")])
        return self


Recording = Annotated[CsvRecording | PyfgRecording, Field(discriminator="format")]
