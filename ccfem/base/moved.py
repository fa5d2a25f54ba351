"""Names that packages had before release 0.2: they still work, or say what replaces them."""

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

_INDICES = (
    *("alignment", "containment", "coverage", "crossings", "curvature", "head", "links"),
    *("manufacture", "matching", "room", "sinuosity", "skin", "space", "spacing"),
    *("stiffness_alignment", "tension_across"),
)

_FOLDED = {
    "body.isolated.process": "body.isolated.limited",
    "body.mesh.check": "body.mesh.hanging body.mesh.in_metres",
    "body.mesh.face_rules": "body.mesh.cell_rules",
    "body.mesh.patches": "body.mesh.face_names",
    "body.mesh.tet_mesh": "body.mesh.cell_mesh body.mesh.flaws body.mesh.pairing",
    "body.meshing.meshed_body": "body.meshing.cache body.meshing.face_groups",
    "body.meshing.planform": "body.meshing.prisms",
    "body.meshing.volume": "body.meshing.fidelity",
    "cases.bodies": (
        "cases.arm_bracket cases.bar cases.corner_bracket cases.crossed cases.lifting_eye "
        "cases.twist_bar cases.two_angle_bracket cases.two_pull_loop"
    ),
    "cases.inspection.part_check": (
        "cases.inspection.cost cases.inspection.load_row cases.inspection.patch_row"
    ),
    "cases.optimised": "cases.passive",
    "cases.part_file": "cases.before_meshing cases.part_regions cases.part_slicing",
    "cases.part_keys": "cases.part_body",
    "cases.reading": "cases.named",
    "cases.shipped": "cases.bracket cases.t_bracket cases.two_load_plate",
    "cli.commands": "cli.in_python cli.papers_again cli.study_file cli.supporting",
    "comparison.files": "comparison.record",
    "comparison.plot.curves": "comparison.plot.stiffness_curves",
    "comparison.report.html_report": (
        "comparison.report.filling comparison.report.part_view comparison.report.report_tables"
    ),
    "comparison.report.layer_view": "comparison.report.path_view",
    "comparison.result": "comparison.summary",
    "comparison.studies.jobs": "comparison.studies.sweep",
    "comparison.studies.running": (
        "comparison.studies.cluster comparison.studies.page comparison.studies.processes "
        "comparison.studies.store"
    ),
    "comparison.studies.study_result": (
        "comparison.studies.study_fronts comparison.studies.study_table"
    ),
    "fem.elasticity.conjugate_gradient": "fem.elasticity.solution",
    "fem.elasticity.direct": "fem.elasticity.skyline fem.elasticity.supernodes",
    "fem.elasticity.error_estimate": "fem.elasticity.patch_recovery",
    "fem.elasticity.held": "fem.elasticity.ties",
    "fem.elasticity.loads": "fem.elasticity.volume_loads",
    "fem.elasticity.nodes": "fem.elasticity.body",
    "fem.elasticity.plausibility": "fem.elasticity.conditioning fem.elasticity.order",
    "fem.elasticity.quick_aggregation": "fem.elasticity.aggregation fem.elasticity.galerkin",
    "fem.elasticity.solve": (
        "fem.elasticity.contact fem.elasticity.refinement fem.elasticity.support_sets"
    ),
    "fem.elasticity.stress_field": (
        "fem.elasticity.part_stress fem.elasticity.probe fem.elasticity.weighted_cases"
    ),
    "fem.elasticity.supports": "fem.elasticity.frames fem.elasticity.springs",
    "fem.elasticity.zone": "fem.elasticity.ball",
    "fem.plates.mesh": "fem.plates.raster_mesh",
    "fem.plates.problem": "fem.plates.stiffness",
    "fem.plates.solve": "fem.plates.assembly fem.plates.field",
    "fem.stress_files.stress_file": (
        "fem.stress_files.frd fem.stress_files.stress_data fem.stress_files.stress_table "
        "fem.stress_files.vtu_tensors"
    ),
    "fem.topopt.compliance": "fem.topopt.equations fem.topopt.groups",
    "fem.topopt.design": "fem.topopt.material_axes",
    "fem.topopt.parametrisation": "fem.topopt.filters fem.topopt.parameters",
    "fem.topopt.part": "fem.topopt.plate_part fem.topopt.walls",
    "fem.topopt.sheet_part": "fem.topopt.sheet_mesh fem.topopt.short_edges",
    "fem.topopt.simp": (
        "fem.topopt.iteration fem.topopt.optimality_criteria fem.topopt.solid_design"
    ),
    "fem.topopt.somp": "fem.topopt.oriented_compliance",
    "fem.topopt.tet_part": "fem.topopt.cut fem.topopt.cut_smoothing",
    "geometry.beads": "geometry.band_overlap",
    "geometry.facets": "geometry.measures",
    "geometry.locate": "geometry.buckets geometry.nearest_on_triangles",
    "geometry.parallel_strands": "geometry.free_ends",
    "geometry.polylines": "geometry.curvature_samples geometry.own_way",
    "geometry.shapes": "geometry.places geometry.sections",
    "judging.evaluation.layer_paths": (
        "judging.evaluation.column judging.evaluation.plane_paths judging.evaluation.printed_stack"
    ),
    "judging.evaluation.strand_rules": "judging.evaluation.printable",
    "judging.virtual_testing.calibration": "judging.virtual_testing.force_displacement",
    "judging.virtual_testing.equilibrium": (
        "judging.virtual_testing.bars judging.virtual_testing.reinforced"
    ),
    "judging.virtual_testing.strand": "judging.virtual_testing.strengths",
    "judging.virtual_testing.strands": "judging.virtual_testing.cut_steps",
    "judging.virtual_testing.virtual_test": "judging.virtual_testing.stiffer",
    "machine.speeds": "machine.speed_table",
    "papers.chen_2021.contents": (
        "papers.chen_2021.claims papers.chen_2021.figures papers.chen_2021.tables "
        "papers.chen_2021.whole"
    ),
    "papers.chen_2021.study": "papers.chen_2021.large_displacement",
    "papers.chen_2021.virtual_test": "papers.chen_2021.oriented",
    "papers.contents": "papers.verdicts",
    "papers.fang_2024.contents": (
        "papers.fang_2024.claims papers.fang_2024.field_study papers.fang_2024.targets "
        "papers.fang_2024.where_layers_open papers.fang_2024.whole"
    ),
    "papers.kipping_2023.chain": "papers.kipping_2023.thickness",
    "papers.kipping_2023.contents": (
        "papers.kipping_2023.claims papers.kipping_2023.fiso_shapes papers.kipping_2023.strength "
        "papers.kipping_2023.trade papers.kipping_2023.whole"
    ),
    "papers.plocher_2022.contents": (
        "papers.plocher_2022.claims papers.plocher_2022.tables papers.plocher_2022.variants "
        "papers.plocher_2022.whole"
    ),
    "papers.plocher_2022.figures": (
        "papers.plocher_2022.benchmark_figures papers.plocher_2022.drawing "
        "papers.plocher_2022.radar"
    ),
    "papers.plocher_2022.plane_study": (
        "papers.plocher_2022.fibre_map papers.plocher_2022.sensitivity"
    ),
    "papers.plocher_2022.plates": "papers.plocher_2022.three_point_bending",
    "papers.wang_2021.contents": (
        "papers.wang_2021.claims papers.wang_2021.tables papers.wang_2021.variants "
        "papers.wang_2021.whole"
    ),
    "papers.wang_2021.figures": "papers.wang_2021.panels",
    "paths.fields.directed": "paths.fields.crease paths.fields.fill",
    "paths.fields.scalar": "paths.fields.levels",
    "paths.fields.tensile": (
        "paths.fields.compatibility paths.fields.layer_tension paths.fields.orientation"
    ),
    "paths.linking.finishing": "paths.linking.clearance paths.linking.conformal",
    "paths.linking.possible_links": "paths.linking.smooth_links",
    "paths.linking.print_order": "paths.linking.print_speed",
    "paths.linking.single_path": "paths.linking.ordering paths.linking.ring_routes",
    "paths.placement.fibre_places": "paths.placement.cut_layer paths.placement.region_shapes",
    "paths.planning.equal_fibre": "paths.planning.dial",
    "paths.planning.infill": "paths.linking.cut_turns paths.planning.short_pieces",
    "paths.planning.mixing": "paths.planning.cutting",
    "paths.planning.plan": "paths.planning.steps",
    "paths.planning.strategy": "paths.planning.planned paths.planning.whole_part",
    "paths.raster.bitmap": "paths.raster.bands",
    "paths.raster.raster_plan": "paths.raster.simplify paths.raster.tracing paths.raster.walking",
    "paths.raster.skeleton": "paths.raster.thinning",
    "paths.splitting.slabs": "paths.splitting.strand_density",
    "printing.curved_plan": "printing.curved_layers printing.head_lean",
    "printing.export.gcode": "printing.export.gcode_head",
    "printing.matrix_lines": "printing.gap_lines",
    "printing.part_moves": "printing.preheating printing.strand_speed printing.tools",
    "printing.print_plan": "printing.pads printing.stacks printing.turns",
    "slicing.guidance.guidance_field": "slicing.guidance.equal_values slicing.guidance.quality",
    "slicing.guidance.joints": "slicing.guidance.joint_lines",
    "slicing.layers.layer": (
        "slicing.layers.holes slicing.layers.layer_stress slicing.layers.plane "
        "slicing.layers.rounded_rings"
    ),
    "slicing.layers.level_surfaces": "slicing.layers.cleaning",
    "slicing.layers.slicer": "slicing.layers.pitch slicing.layers.standing",
    "slicing.principal_lines.critical": "slicing.principal_lines.strongest",
    "slicing.principal_lines.trace": "slicing.principal_lines.cell_walk",
    "slicing.slicers.load_oriented": "slicing.guidance.across",
    "slicing.slicers.surfaces": "slicing.layers.foreign",
    "strategies.fibre_aware.strand_moves": "strategies.fibre_aware.strand_pull",
    "strategies.fibre_aware.stream_design": "strategies.fibre_aware.field_bends",
    "strategies.fibre_aware.stream_paths": "strategies.fibre_aware.slide_in",
    "strategies.fiso": "geometry.contour_tree paths.linking.first_in",
    "strategies.isocurve": "paths.linking.spiral",
    "strategies.mat": "geometry.medial_fill",
    "strategies.mps": "geometry.abutting geometry.guide_fit paths.raster.guides",
    "strategies.stream_function": "strategies.fibre_aware.design_lengths",
    "strategies.streamline": "paths.fields.evenly_spaced",
    "strategies.stress_tracing.stress_lines": "strategies.stress_tracing.criterion",
    "strategies.stress_tracing.tracks": "strategies.stress_tracing.turning",
    "strategies.svt": (
        "strategies.stress_tracing.alike strategies.stress_tracing.blobs "
        "strategies.stress_tracing.symmetric strategies.stress_tracing.walk"
    ),
    "strategies.winding": (
        "strategies.winding_curves.annulus strategies.winding_curves.bends "
        "strategies.winding_curves.even_levels strategies.winding_curves.paper_field"
    ),
    "strategies.winding_curves.joining_curves": "strategies.winding_curves.straighten",
    "strategies.winding_curves.piece": "strategies.winding_curves.joint_loops",
}
"""Modules that became sections of another one, by that one."""

MOVED = {
    "printing.slabs": "paths.splitting.slabs",
    "printing.strand_density": "paths.splitting.slabs",
    **{part: whole for whole, parts in _FOLDED.items() for part in parts.split()},
    "arrays": "base.arrays",
    "checks": "base.checks",
    "comparison.charts": "comparison.report.charts",
    "comparison.layer_view": "comparison.report.layer_view",
    "comparison.part_view": "comparison.report.html_report",
    "comparison.path_view": "comparison.report.layer_view",
    "comparison.report_tables": "comparison.report.html_report",
    "display": "base.display",
    "elasticity": "fem.elasticity",
    "errors": "base.errors",
    "evaluation": "judging.evaluation",
    **{f"evaluation.{name}": f"judging.evaluation.indices.{name}" for name in _INDICES},
    "export": "printing.export",
    "fibre_aware": "strategies.fibre_aware",
    "fields": "paths.fields",
    "guidance": "slicing.guidance",
    "inspection": "cases.inspection",
    "io": "body.files",
    "io.csv_table": "base.csv_table",
    "io.folder": "base.folder",
    "io.frd": "fem.stress_files.stress_file",
    "io.result_folder": "base.result_folder",
    "io.stress_data": "fem.stress_files.stress_file",
    "io.stress_file": "fem.stress_files.stress_file",
    "io.stress_table": "fem.stress_files.stress_file",
    "io.toml": "base.toml",
    "io.vtu_tensors": "fem.stress_files.stress_file",
    "io.whole": "base.whole",
    "isolated": "body.isolated",
    "judging.virtual_testing.interlayer": "judging.virtual_testing.failure_laws.interlayer",
    "layers": "slicing.layers",
    "layers.slicing": "slicing.slicers",
    "linking": "paths.linking",
    "materials": "fem.materials",
    "mesh": "body.mesh",
    "mesh.facets": "geometry.facets",
    "mesh.measures": "geometry.facets",
    "meshing": "body.meshing",
    "placement": "paths.placement",
    "planning": "paths.planning",
    "plates": "fem.plates",
    "plot": "comparison.plot",
    "plugins": "base.plugins",
    "principal_lines": "slicing.principal_lines",
    "progress": "base.progress",
    "raster": "paths.raster",
    "report": "comparison.report",
    "stress_tracing": "strategies.stress_tracing",
    "studies": "comparison.studies",
    "support": "printing.support",
    "tensor": "base.tensor",
    "threads": "base.parallel",
    "toolpaths": "paths.toolpaths",
    "topopt": "fem.topopt",
    "virtual_testing": "judging.virtual_testing",
    "virtual_testing.ball": "fem.elasticity.zone",
    "virtual_testing.zone": "fem.elasticity.zone",
    "winding": "strategies.winding_curves",
}
"""New name of each package and module by its old one, both below ``ccfem``."""

GONE = {
    "papers.layer_traction": (
        "use ccfem.judging.virtual_testing.failure_laws.interlayer.layer_traction, which returns "
        "the averaged stress too: opening, sliding, tensor"
    ),
}
"""What replaces modules whose functions changed when they moved."""


class _Finder(MetaPathFinder):
    """Finds a module under its old name."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a spec that yields the module of the new name, or None for any other."""
        if not name.startswith("ccfem."):
            return None
        stem = name.removeprefix("ccfem.")
        if stem in GONE:
            raise ModuleNotFoundError(f"{name} is gone: {GONE[stem]}", name=name)
        old, rest = stem, ""
        while old and old not in MOVED:
            old, _, last = old.rpartition(".")
            rest = f".{last}{rest}"
        if not old:
            return None
        loader: Any = _Loader(f"ccfem.{MOVED[old]}{rest}")
        return ModuleSpec(name, loader)


class _Loader(Loader):
    """Yields a module that has another name."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._spec: Any = None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module of the new name."""
        module = importlib.import_module(self._name)
        message = f"{spec.name} is called {self._name} now: import it by this name"
        warnings.warn(message, DeprecationWarning, stacklevel=2)
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Leave a module as it is: it ran under its new name."""
        module.__spec__ = self._spec


def find_moved() -> None:
    """Let imports find modules under their old names."""
    if not any(type(finder).__name__ == "_Finder" for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())
