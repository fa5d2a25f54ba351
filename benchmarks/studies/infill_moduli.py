"""How stiff infill is: voxels of its lines as they are laid, beside the laws of `ccfem.fem`.

Run ``python -m benchmarks.studies.infill_moduli [INFILL,...] [DENSITY,...]``. A cell of the pattern
repeats in all directions; its voxels are cubes with linear displacement, solved by conjugate
gradients that the periodic full cell preconditions, under six mean strains. Lines are as wide as
their spacing and density say, walls stand layer on layer, and a gyroid's lines are those of its
planes at the middle of each layer. A row a pattern: moduli over that of the plastic, Poisson's
ratios, and below them those of the law.
"""

import sys
from collections.abc import Sequence

import numpy as np
from scipy import ndimage
from threadpoolctl import threadpool_limits

from ccfem.paths.plastic.as_printed import infill_stiffness
from ccfem.paths.plastic.plastic import GYROID

__all__ = ["cell_of", "homogenised", "moduli"]

_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
POISSON = 0.35


def _cube(poisson: float) -> np.ndarray:
    """Stiffness (24, 24) of a cube of side 1 and modulus 1."""
    lame, shear = poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), 0.5 / (1.0 + poisson)
    law = np.diag([2.0 * shear] * 3 + [shear] * 3)
    law[:3, :3] += lame
    stiffness = np.zeros((24, 24))
    gauss = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
    for point in np.stack(np.meshgrid(gauss, gauss, gauss), axis=-1).reshape(-1, 3):
        shape = np.where(_CORNERS == 1, point, 1.0 - point)
        sign = np.where(_CORNERS == 1, 1.0, -1.0)
        strain = np.zeros((6, 24))
        for a in range(8):
            x, y, z = (sign[a, k] * np.prod(np.delete(shape[a], k)) for k in range(3))
            strain[:, 3 * a : 3 * a + 3] = [
                *([x, 0, 0], [0, y, 0], [0, 0, z]),
                *([0, z, y], [z, 0, x], [y, x, 0]),
            ]
        stiffness += strain.T @ law @ strain / 8.0
    return stiffness


@threadpool_limits.wrap(limits=1, user_api="blas")  # more threads wait for each other
def homogenised(
    voxels: np.ndarray, poisson: float = POISSON, tolerance: float = 1e-4
) -> np.ndarray:
    """Mean stiffness (6, 6), over the modulus, of a cell of voxels that repeats."""
    cube, shape, size = _cube(poisson), voxels.shape, voxels.size
    at = np.indices(shape).reshape(3, -1)[:, voxels.ravel()]
    nodes = np.stack(
        [
            np.ravel_multi_index((at + corner[:, None]) % np.array(shape)[:, None], shape)
            for corner in _CORNERS
        ],
        axis=1,
    )

    def summed(forces: np.ndarray) -> np.ndarray:
        forces = forces.reshape(-1, 3)
        return np.stack([np.bincount(nodes.ravel(), forces[:, k], size) for k in range(3)])

    def applied(moved: np.ndarray) -> np.ndarray:
        return summed(moved[:, nodes].transpose(1, 2, 0).reshape(-1, 24) @ cube)

    # The full cell in waves, whose stiffness (3, 3) each has an inverse but for that of length 0.
    waves = np.meshgrid(
        *(2.0 * np.pi * np.fft.fftfreq(n) for n in shape[:2]),
        2.0 * np.pi * np.arange(shape[2] // 2 + 1) / shape[2],
        indexing="ij",
    )
    phase = np.exp(1j * np.einsum("ck,kxyz->cxyz", _CORNERS, np.array(waves)))
    blocks = cube.reshape(8, 3, 8, 3)
    full = np.einsum("axyz,aibj,bxyz->xyzij", phase.conj(), blocks, phase, optimize=True)
    full[0, 0, 0] = np.eye(3)
    inverse = np.linalg.inv(full)
    inverse[0, 0, 0] = 0.0

    def conditioned(forces: np.ndarray) -> np.ndarray:
        spectrum = np.fft.rfftn(forces.reshape(3, *shape), axes=(1, 2, 3))
        spectrum = np.einsum("xyzij,jxyz->ixyz", inverse, spectrum)
        return np.fft.irfftn(spectrum, s=shape, axes=(1, 2, 3)).reshape(3, -1)

    fields = []
    for case in range(6):
        e = 0.5 * np.eye(6)[case] * np.array([2.0, 2.0, 2.0, 1.0, 1.0, 1.0])
        mean = np.array([[e[0], e[5], e[4]], [e[5], e[1], e[3]], [e[4], e[3], e[2]]])
        affine = (_CORNERS @ mean).ravel()
        moved = np.zeros((3, size))
        left = -summed(np.tile(cube @ affine, (len(nodes), 1)))
        first, way = float(np.linalg.norm(left)), conditioned(left)
        step = float(np.vdot(left, way))
        for _ in range(2000):
            if np.linalg.norm(left) <= tolerance * first:
                break
            pull = applied(way)
            length = step / float(np.vdot(way, pull))
            moved, left = moved + length * way, left - length * pull
            better = conditioned(left)
            before, step = step, float(np.vdot(left, better))
            way = better + step / before * way
        fields.append(moved[:, nodes].transpose(1, 2, 0).reshape(-1, 24) + affine)
    return np.array([[np.vdot(a @ cube, b) for b in fields] for a in fields]) / size


def moduli(stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Young's moduli along the axes, shear moduli 23, 13, 12, and Poisson's ratios 12 and 13."""
    compliance = np.linalg.inv(stiffness)
    young, shear = 1.0 / np.diag(compliance)[:3], 1.0 / np.diag(compliance)[3:]
    return young, shear, -compliance[0, 1:3] * young[0]


def cell_of(infill: str, density: float, voxels: int, height: int) -> np.ndarray:
    """Voxels of a cell of infill, lines so many voxels wide and high."""
    if infill == "gyroid":
        return _gyroid(density, voxels, height)
    period = round((2.0 if infill == "grid" else 1.0) * voxels / density)
    cell = np.zeros((period, period, 1 if infill == "grid" else 2 * height), dtype=bool)
    cell[:voxels, :, : cell.shape[2] if infill == "grid" else height] = True
    cell[:, :voxels, 0 if infill == "grid" else height :] = True
    return cell


def _gyroid(density: float, voxels: int, height: int) -> np.ndarray:
    """Voxels of a gyroid whose lines are laid layer by layer."""
    layers = round(GYROID * voxels / density / height)
    count, fine = layers * height, 3
    x, y = np.meshgrid(*[2.0 * np.pi * (np.arange(count * fine) + 0.5) / (count * fine)] * 2)
    cell = np.zeros((count, count, count), dtype=bool)
    for layer in range(layers):
        z = 2.0 * np.pi * (layer + 0.5) / layers
        field = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
        margin = 2 * voxels * fine
        inside = np.pad(field > 0.0, margin, mode="wrap")
        off = sum(ndimage.distance_transform_edt(side) for side in (inside, ~inside)) - 0.5
        line = (off <= 0.5 * voxels * fine)[margin:-margin, margin:-margin]
        line = line.reshape(count, fine, count, fine).mean(axis=(1, 3)) >= 0.5
        cell[:, :, layer * height : (layer + 1) * height] = line[:, :, None]
    return cell


def _said(numbers: Sequence[np.ndarray]) -> str:
    return "  ".join(f"{x:7.4f}" for x in np.concatenate(numbers))


def main(arguments: list[str]) -> None:
    """Print the table."""
    patterns = (arguments[0] if arguments else "lines,grid,gyroid").split(",")
    densities = (arguments[1] if len(arguments) > 1 else "0.1,0.2,0.4,0.6").split(",")
    print(
        "infill  density h/w     E1       E2       E3       G23      G13      G12      nu12    nu13"
    )
    for infill in patterns:
        for density in map(float, densities):
            for height in (4,) if infill == "grid" else (4, 2):
                found = moduli(homogenised(cell_of(infill, density, 4, height)))
                print(f"{infill:8} {density:4g} {height / 4:5g} {_said(found)}", flush=True)
            law = infill_stiffness(infill, density, 1.0, POISSON)
            print(f"{'':8} {'':4} {'law':>5} {_said(moduli(law))}")


if __name__ == "__main__":
    main(sys.argv[1:])
