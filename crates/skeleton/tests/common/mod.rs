//! Shared by the test files: a reader for the NIfTI files of the test data, and phantoms.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "tests say what they found, and fail aloud"
)]
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::disallowed_methods, reason = "tests find the real data by ESPALIER_DATA")]

pub(crate) mod curve;

use std::io::Read as _;
use std::path::{Path, PathBuf};

use espalier_model::{Grid, Mask};
use glam::DVec3;

/// The folder of real data; `None`, said aloud, if the environment names none.
pub(crate) fn data_folder() -> Option<PathBuf> {
    let folder = std::env::var("ESPALIER_DATA").ok().filter(|folder| !folder.is_empty()).map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: ESPALIER_DATA not set");
    }
    folder
}

/// A mask of the nonzero voxels of a little-endian 8- or 16-bit NIfTI-1 file, with its spacing but no other
/// geometry.
pub(crate) fn read_mask(path: &Path) -> Mask {
    let compressed = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut bytes = Vec::new();
    flate2::read::MultiGzDecoder::new(&compressed[..]).read_to_end(&mut bytes).expect("gzip");
    let short = |at: usize| i16::from_le_bytes([bytes[at], bytes[at + 1]]);
    let float = |at: usize| f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    let shape = [42, 44, 46].map(|at| usize::try_from(short(at)).expect("extent"));
    let spacing = DVec3::from_array([80, 84, 88].map(|at| f64::from(float(at))));
    let grid = Grid::axis_aligned(shape, spacing, DVec3::ZERO).expect("grid");
    let width = usize::try_from(short(72)).expect("bitpix") / 8;
    let body = &bytes[float(108) as usize..][..grid.n_voxels() * width];
    let voxels: Vec<bool> =
        body.chunks_exact(width).map(|voxel| voxel.iter().any(|&byte| byte != 0)).collect();
    Mask::from_voxels(grid, &voxels)
}

/// A mask on a grid of spacing 1 from a predicate of the voxel coordinates.
pub(crate) fn mask_of(shape: [usize; 3], inside: impl Fn(DVec3) -> bool) -> Mask {
    Mask::from_fn(grid(shape), |voxel| inside(DVec3::from_array(voxel.map(|c| c as f64))))
}

/// A grid of spacing 1.
pub(crate) fn grid(shape: [usize; 3]) -> Grid {
    Grid::axis_aligned(shape, DVec3::ONE, DVec3::ZERO).expect("grid")
}

/// The skeleton as a mask on the same grid.
pub(crate) fn skeleton_mask(mask: &Mask, params: &espalier_skeleton::Params) -> Mask {
    let thinned = espalier_skeleton::skeletonize(mask, params).expect("not empty");
    let mut out = Mask::empty(mask.grid().clone());
    for voxel in thinned.skeleton.voxels() {
        out.bits_mut().set(voxel.map(|c| c as usize));
    }
    out
}

/// 26-connected components and Euler number, counted cell by cell, apart from the crate's own code.
pub(crate) fn topology(mask: &Mask) -> (usize, i32) {
    let mut cells = std::collections::BTreeSet::new();
    let mut left = std::collections::BTreeSet::new();
    for voxel in mask.voxels().map(|voxel| voxel.map(|c| c as i64)) {
        left.insert(voxel);
        for d in offsets() {
            cells.insert([0, 1, 2].map(|axis| 2 * voxel[axis] + d[axis]));
        }
    }
    let euler =
        cells.iter().map(|cell| if cell.iter().filter(|c| *c % 2 != 0).count() % 2 == 1 { 1 } else { -1 });
    let euler = euler.sum();
    let mut n_components = 0;
    while let Some(seed) = left.pop_first() {
        n_components += 1;
        let mut stack = vec![seed];
        while let Some(voxel) = stack.pop() {
            for d in offsets() {
                let neighbor = [0, 1, 2].map(|axis| voxel[axis] + d[axis]);
                if left.remove(&neighbor) {
                    stack.push(neighbor);
                }
            }
        }
    }
    (n_components, euler)
}

fn offsets() -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(|bit| [bit % 3 - 1, bit / 3 % 3 - 1, bit / 9 - 1])
}

/// Small volumes and what scikit-image 0.26 leaves of them; the format stands in `scripts/lee94-fixture`.
const FIXTURE: &[u8] = include_bytes!("../../../../fixtures/lee94.tsv.gz");

/// The cases of the fixture: name, volume, skeleton by scikit-image.
pub(crate) fn fixture() -> Vec<(String, Mask, Mask)> {
    let mut text = String::new();
    flate2::read::GzDecoder::new(FIXTURE).read_to_string(&mut text).expect("gzip");
    let case = |line: &str| {
        let [name, nx, ny, nz, volume, skeleton] = line.split('\t').collect::<Vec<_>>()[..] else {
            panic!("not six fields: {line}")
        };
        let shape = [nx, ny, nz].map(|extent| extent.parse().expect("an extent"));
        let mask = |hex| Mask::from_voxels(grid(shape), &unpacked(hex, shape.iter().product()));
        (name.to_owned(), mask(volume), mask(skeleton))
    };
    text.lines().skip(1).map(case).collect()
}

/// Voxels from hex digits, four to a digit, the first voxel the highest bit.
fn unpacked(hex: &str, n_voxels: usize) -> Vec<bool> {
    let bits = hex.chars().flat_map(|digit| {
        let four = digit.to_digit(16).expect("a hex digit");
        (0..4).rev().map(move |bit| four >> bit & 1 == 1)
    });
    let mut voxels: Vec<bool> = bits.collect();
    assert!(voxels.len() >= n_voxels && voxels.split_off(n_voxels).iter().all(|&filler| !filler));
    voxels
}
