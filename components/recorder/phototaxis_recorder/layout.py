"""The layout of the viewer, and everything in the picture that does not change during a run."""

import rerun as rr
import rerun.blueprint as rrb
from phototaxis.geometry.arena import Arena

from phototaxis_recorder.colors import BLUE, INK, ORANGE, RED, STONE, YELLOW, of_light
from phototaxis_recorder.field import light_field
from phototaxis_recorder.policy_map import HEIGHT, WIDTH, frame

TRAIL_TICKS = 300
"""Length of the trail behind the robot, ticks."""
PLOT_TICKS = 600
"""Ticks that the plots of reward and light show."""
PAPER_SUCCESS_RATE = 0.8
"""The success rate that the paper reports for its Q-table with the simple percept: "upwards of 80%" (section 6.2)."""
MEAN_TICKS = 100
"""Ticks over which the mean reward is averaged."""


def blueprint(arena: Arena, epochs: int) -> rrb.Blueprint:
    """Lay out the viewer: arena and events on the left, plots in the middle, what was learned on the right."""
    width, height = arena.size
    edge = 0.04 * max(width, height)

    def back(ticks: int) -> rrb.VisibleTimeRanges:
        start, end = rrb.TimeRangeBoundary.cursor_relative(seq=-ticks), rrb.TimeRangeBoundary.cursor_relative()
        return rrb.VisibleTimeRanges(timeline="tick", start=start, end=end)

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
        overrides={"/world/trail": back(TRAIL_TICKS)},
    )
    success = rrb.TimeSeriesView(
        origin="/plots/success",
        name="Success, last 50 episodes",
        axis_x=whole,
        axis_y=rrb.ScalarAxis(range=(0.0, 1.02)),
    )
    reward = rrb.TimeSeriesView(
        origin="/plots",
        contents=["/plots/reward", "/plots/mean_reward"],
        name=f"Reward, and its mean over {MEAN_TICKS} ticks",
        time_ranges=back(PLOT_TICKS),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(world, rrb.TextLogView(origin="/episodes", name="Episodes and events"), row_shares=[3, 1]),
            rrb.Vertical(
                success,
                reward,
                rrb.TimeSeriesView(origin="/plots/light", name="Light, left and right", time_ranges=back(PLOT_TICKS)),
                rrb.TimeSeriesView(origin="/plots/temperature", name="Temperature", axis_x=whole),
                row_shares=[3, 3, 2, 2],
            ),
            rrb.Vertical(
                rrb.BarChartView(origin="/learner/current", name="Q of the nine actions, here and now"),
                rrb.Spatial2DView(
                    origin="/learner/policy",
                    name="Policy: best motion in each state",
                    background=[250, 250, 248],
                    visual_bounds=rrb.VisualBounds2D(x_range=[-0.1, WIDTH + 0.1], y_range=[-0.1, HEIGHT + 0.1]),
                ),
                rrb.TensorView(origin="/learner/table", name="Q(state, action)", view_fit="fill"),
                rrb.BarChartView(origin="/learner/visits", name="Visits of each state"),
                row_shares=[2, 3, 2, 2],
            ),
            column_shares=[5, 4, 3],
        ),
        rrb.TimePanel(timeline="tick", play_state="following", state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def draw_world(recording: rr.RecordingStream, arena: Arena) -> None:
    """Draw the floor, walls, obstacles, lights and the robot's body. Rerun's views are y-down, so y is mirrored."""

    def log(path: str, *what: rr.AsComponents) -> None:
        rr.log(path, *what, static=True, recording=recording)

    width, height = arena.size
    log("world", rr.Transform3D(scale=[1, -1, 1]))
    field = of_light(light_field(arena))
    rows, columns, _ = field.shape
    log("world/field", rr.Transform3D(scale=[width / columns, height / rows, 1]), rr.Image(field, draw_order=-20))
    room = [(0, 0), (width, 0), (width, height), (0, height), (0, 0)]
    log("world/room", rr.LineStrips2D([room], colors=INK, radii=0.04))
    if arena.walls:
        log(
            "world/walls",
            rr.LineStrips2D(
                [[wall.start, wall.end] for wall in arena.walls],
                radii=[wall.thickness / 2 for wall in arena.walls],
                colors=STONE,
            ),
        )
    if arena.polygons:
        strips = [[*polygon.corners, polygon.corners[0]] for polygon in arena.polygons]
        log("world/polygons", rr.LineStrips2D(strips, colors=STONE, radii=0.03))
    if arena.discs:
        discs = arena.discs
        log(
            "world/discs",
            rr.Points2D([d.centre for d in discs], radii=[d.radius for d in discs], colors=STONE),
        )
    log("learner/policy/frame", frame())
    places = [light.position for light in arena.lights]
    log("world/light", rr.Points2D(places, colors=YELLOW, radii=0.14, labels=["light"] * len(places)))
    robot = arena.robot
    x, y = robot.length / 2, robot.width / 2
    body = [(x, y), (-x, y), (-x, -y), (x, -y), (x, y)]
    log("world/robot/body", rr.LineStrips2D([body, [(0, 0), (x, 0)]], colors=BLUE, radii=0.03))
    log("world/robot/eyes", rr.Points2D(list(robot.light_sensors), colors=YELLOW, radii=0.05))
    log("world/robot/sonar", rr.Arrows2D.from_fields(radii=0.01))
    log("world/trail", rr.Points2D.from_fields(radii=[0.035]))
    for path, names, colors in (
        ("plots/success/rate", ["success"], [BLUE]),
        ("plots/success/paper", ["the paper's 80%"], [STONE]),
        ("plots/reward", ["reward"], [(225, 150, 130)]),
        ("plots/mean_reward", ["mean"], [RED]),
        ("plots/light/left", ["left"], [BLUE]),
        ("plots/light/right", ["right"], [ORANGE]),
        ("plots/temperature", ["temperature"], [STONE]),
    ):
        log(path, rr.SeriesLines(names=names, colors=colors, widths=[1.5]))
