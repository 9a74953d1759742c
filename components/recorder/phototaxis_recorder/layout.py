"""The layout of the viewer: the whole story at first sight."""

import rerun as rr
import rerun.blueprint as rrb
from phototaxis.arena import Arena

TRAIL = 300
"""Ticks of trail that are shown behind the robot."""
PLOTS = 600
"""Ticks that the fast plots look back."""


def blueprint(arena: Arena, epochs: int) -> rrb.Blueprint:
    """Arena and episode log on the left; success, reward, light and temperature; what was learned."""
    width, height = arena.size
    edge = 0.04 * max(width, height)
    trail = rrb.VisibleTimeRanges(
        timeline="tick",
        start=rrb.TimeRangeBoundary.cursor_relative(seq=-TRAIL),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    recent = rrb.VisibleTimeRanges(
        timeline="tick",
        start=rrb.TimeRangeBoundary.cursor_relative(seq=-PLOTS),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    whole = None
    if epochs:
        ends = (rrb.TimeRangeBoundary.absolute(seq=tick) for tick in (0, round(1.05 * epochs)))
        whole = rrb.TimeAxis(view_range=rrb.TimeRange(*ends))
    world = rrb.Spatial2DView(
        origin="/",
        contents=["/world/**"],
        name=f"Arena: {arena.name}",
        background=[246, 246, 243],
        visual_bounds=rrb.VisualBounds2D(x_range=[-edge, width + edge], y_range=[-height - edge, edge]),
        overrides={"/world/trail": trail},
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(world, rrb.TextLogView(origin="/episodes", name="Episodes"), row_shares=[4, 1]),
            rrb.Vertical(
                rrb.TimeSeriesView(
                    origin="/plots/success",
                    name="Success, last 50 episodes",
                    axis_x=whole,
                    axis_y=rrb.ScalarAxis(range=(0.0, 1.0)),
                ),
                rrb.TimeSeriesView(origin="/plots/reward", name="Reward", time_ranges=recent),
                rrb.TimeSeriesView(origin="/plots/light", name="Light, left and right", time_ranges=recent),
                rrb.TimeSeriesView(origin="/plots/temperature", name="Temperature", axis_x=whole),
            ),
            rrb.Vertical(
                rrb.TensorView(origin="/learner/table", name="Q(state, action)", view_fit="fill"),
                rrb.BarChartView(origin="/learner/visits", name="Visits of each state"),
                row_shares=[2, 1],
            ),
            column_shares=[5, 4, 3],
        ),
        rrb.TimePanel(timeline="tick", play_state="following", state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def draw_world(recording: rr.RecordingStream, arena: Arena) -> None:
    """What does not change: floor, walls, obstacles, lights, the robot's body. Views are y-down: y is mirrored."""
    ink, stone, yellow, blue = [60, 60, 60], [120, 120, 120], [240, 180, 0], [20, 90, 170]

    def log(path: str, *what: rr.AsComponents) -> None:
        rr.log(path, *what, static=True, recording=recording)

    width, height = arena.size
    log("world", rr.Transform3D(scale=[1, -1, 1]))
    room = [(0, 0), (width, 0), (width, height), (0, height), (0, 0)]
    log("world/room", rr.LineStrips2D([room], colors=ink, radii=0.04))
    if arena.walls:
        log(
            "world/walls",
            rr.LineStrips2D(
                [[wall.start, wall.end] for wall in arena.walls],
                radii=[wall.thickness / 2 for wall in arena.walls],
                colors=stone,
            ),
        )
    if arena.polygons:
        strips = [[*polygon.corners, polygon.corners[0]] for polygon in arena.polygons]
        log("world/polygons", rr.LineStrips2D(strips, colors=stone, radii=0.03))
    if arena.discs:
        discs = arena.discs
        log(
            "world/discs",
            rr.Points2D([d.centre for d in discs], radii=[d.radius for d in discs], colors=stone),
        )
    places = [light.position for light in arena.lights]
    log("world/light", rr.Points2D(places, colors=yellow, radii=0.14, labels=["light"] * len(places)))
    robot = arena.robot
    x, y = robot.length / 2, robot.width / 2
    body = [(x, y), (-x, y), (-x, -y), (x, -y), (x, y)]
    log("world/robot/body", rr.LineStrips2D([body, [(0, 0), (x, 0)]], colors=blue, radii=0.03))
    log("world/robot/eyes", rr.Points2D(list(robot.light_sensors), colors=yellow, radii=0.05))
    log("world/robot/sonar", rr.Arrows2D.from_fields(colors=[150, 175, 205, 150], radii=0.008))
    log("world/trail", rr.Points2D.from_fields(colors=[[200, 70, 40, 140]], radii=[0.035]))
    for path, names, colors in (
        ("plots/success", ["success"], [[20, 90, 170]]),
        ("plots/reward", ["reward"], [[200, 70, 40]]),
        ("plots/light/left", ["left"], [[20, 90, 170]]),
        ("plots/light/right", ["right"], [[240, 150, 0]]),
        ("plots/temperature", ["temperature"], [[120, 120, 120]]),
    ):
        log(path, rr.SeriesLines(names=names, colors=colors, widths=[1.5]))
