//! A volume's axis order in its file does not matter: one organ stored in 48 ways and three formats gives one mask, tree
//! and embedding, all digits of them, upright or oblique, with any spacing; its mirror image gives others. A CT gives
//! one mask.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::path::Path;

use espalier_model::{Mask, nifti_out, swc};
use espalier_pipeline::Stage;
use espalier_tests::{real_data, run_range, set, small_swarm};
use espalier_volume::{ReadOptions, read_mask};
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// Voxels of the phantom along its own R, A, S.
const SHAPE: [usize; 3] = [24, 20, 30];
/// Whatever is made from a mask and does not tell how it was stored.
const RESULTS: [&str; 10] = [
    "stages/01-volume/mask.nii.gz",
    "stages/02-skeleton/skeleton.nii.gz",
    "stages/03-radius/radius.nii.gz",
    "stages/03-radius/spheres.tsv",
    "branches.nii.gz",
    "tree.swc",
    "branches.tsv",
    "topology.tsv",
    "nodes.tsv",
    "embedding.json",
];

/// A trunk with three branches, no two alike: no turn and no mirror maps it to itself.
fn is_organ([r, a, s]: [usize; 3]) -> bool {
    let point = DVec3::new(r as f64 * 0.5, a as f64, s as f64 * 0.5);
    let tubes = [
        ([6.0, 9.0, 14.0], [6.0, 9.0, 7.0], 1.6),
        ([6.0, 9.0, 7.0], [2.0, 9.0, 1.5], 1.3),
        ([6.0, 9.0, 7.0], [10.0, 15.0, 3.0], 1.2),
        ([6.0, 9.0, 10.0], [10.5, 4.0, 12.5], 1.1),
    ];
    tubes.iter().any(|&(from, to, radius)| {
        let (from, to) = (DVec3::from_array(from), DVec3::from_array(to));
        let share = ((point - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
        point.distance(from + (to - from) * share) <= radius
    })
}

/// What a file holds: voxels, x fastest, and RAS+ mm from them.
#[derive(Clone)]
struct Scan {
    shape: [usize; 3],
    affine: DAffine3,
    voxels: Vec<i16>,
}

/// One way to store a scan: which of its axes each voxel axis runs along, and whether forwards.
#[derive(Clone, Copy, Debug)]
struct Order {
    axes: [usize; 3],
    is_forward: [bool; 3],
}

impl Order {
    fn all() -> Vec<Self> {
        let permutations = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let signs = (0..8_u32).map(|bits| [0, 1, 2].map(|axis| bits >> axis & 1 == 0));
        signs.flat_map(|is_forward| permutations.map(|axes| Self { axes, is_forward })).collect()
    }

    /// The scan in this order: every voxel where it was in the world.
    fn of(self, scan: &Scan) -> Scan {
        let shape = self.axes.map(|axis| scan.shape[axis]);
        let mut origin = scan.affine.translation;
        let columns = [0, 1, 2].map(|voxel_axis| {
            let (axis, is_forward) = (self.axes[voxel_axis], self.is_forward[voxel_axis]);
            let step = scan.affine.matrix3.col(axis);
            origin += if is_forward { DVec3::ZERO } else { step * (scan.shape[axis] - 1) as f64 };
            if is_forward { step } else { -step }
        });
        let [nx, ny, _] = shape;
        let stored = |index: usize| {
            let place = [index % nx, index / nx % ny, index / (nx * ny)];
            let mut voxel = [0; 3];
            for (voxel_axis, &axis) in self.axes.iter().enumerate() {
                let along = place[voxel_axis];
                voxel[axis] = if self.is_forward[voxel_axis] { along } else { scan.shape[axis] - 1 - along };
            }
            scan.voxels[(voxel[2] * scan.shape[1] + voxel[1]) * scan.shape[0] + voxel[0]]
        };
        let voxels = (0..scan.voxels.len()).map(stored).collect();
        let affine = DAffine3::from_cols(columns[0], columns[1], columns[2], origin);
        Scan { shape, affine, voxels }
    }
}

impl Scan {
    /// The phantom with voxels of this size, turned in space by `degrees`.
    fn organ(spacing_mm: [f64; 3], origin_mm: [f64; 3], degrees: f64) -> Self {
        let [nx, ny, nz] = SHAPE;
        let place = |index: usize| [index % nx, index / nx % ny, index / (nx * ny)];
        let voxels = (0..nx * ny * nz).map(|index| i16::from(is_organ(place(index)))).collect();
        let turn = DMat3::from_quat(DQuat::from_axis_angle(
            DVec3::new(1.0, 2.0, 3.0).normalize(),
            degrees.to_radians(),
        ));
        let axes = turn * DMat3::from_diagonal(DVec3::from_array(spacing_mm));
        let affine = DAffine3::from_mat3_translation(axes, DVec3::from_array(origin_mm));
        Self { shape: SHAPE, affine, voxels }
    }

    /// The mirror image, in the same grid.
    fn mirrored(mut self) -> Self {
        self.voxels.chunks_exact_mut(self.shape[0]).for_each(<[i16]>::reverse);
        self
    }

    /// A NIfTI-1 file with an sform, whose numbers are single.
    fn nifti(&self) -> Vec<u8> {
        let mut bytes = vec![0_u8; 352];
        let mut put =
            |offset: usize, field: &[u8]| bytes[offset..offset + field.len()].copy_from_slice(field);
        let columns = [self.affine.x_axis, self.affine.y_axis, self.affine.z_axis, self.affine.translation];
        put(0, &348_i32.to_le_bytes());
        put(40, &3_i16.to_le_bytes());
        for (axis, (extent, column)) in self.shape.into_iter().zip(columns).enumerate() {
            put(42 + 2 * axis, &(extent as i16).to_le_bytes());
            put(80 + 4 * axis, &(column.length() as f32).to_le_bytes());
        }
        put(70, &4_i16.to_le_bytes());
        put(72, &16_i16.to_le_bytes());
        put(108, &352_f32.to_le_bytes());
        put(123, &[2]);
        put(254, &1_i16.to_le_bytes());
        for row in 0..3 {
            for (column, vector) in columns.into_iter().enumerate() {
                put(280 + 16 * row + 4 * column, &(vector[row] as f32).to_le_bytes());
            }
        }
        put(344, b"n+1\0");
        bytes.extend(self.voxels.iter().flat_map(|value| value.to_le_bytes()));
        bytes
    }

    /// The axes and the origin in LPS.
    fn lps(&self) -> [DVec3; 4] {
        [self.affine.x_axis, self.affine.y_axis, self.affine.z_axis, self.affine.translation]
            .map(|v| v * DVec3::new(-1.0, -1.0, 1.0))
    }

    fn nrrd(&self) -> Vec<u8> {
        let vector = |v: DVec3| format!("({},{},{})", v.x, v.y, v.z);
        let ([nx, ny, nz], [x, y, z, origin]) = (self.shape, self.lps().map(vector));
        let header = format!(
            "NRRD0004\ntype: short\nendian: little\ndimension: 3\nspace: left-posterior-superior\nsizes: {nx} {ny} {nz}\n\
             space directions: {x} {y} {z}\nencoding: raw\nspace origin: {origin}\n\n"
        );
        header.into_bytes().into_iter().chain(self.voxels.iter().flat_map(|v| v.to_le_bytes())).collect()
    }

    fn metaimage(&self) -> Vec<u8> {
        let [x, y, z, origin] = self.lps();
        let vector = |v: DVec3| format!("{} {} {}", v.x, v.y, v.z);
        let ([nx, ny, nz], spacing) = (self.shape, DVec3::new(x.length(), y.length(), z.length()));
        let rows = [x / spacing.x, y / spacing.y, z / spacing.z].map(vector).join(" ");
        let (spacing, origin) = (vector(spacing), vector(origin));
        let header = format!(
            "ObjectType = Image\nNDims = 3\nTransformMatrix = {rows}\nOffset = {origin}\nElementSpacing = {spacing}\n\
             DimSize = {nx} {ny} {nz}\nElementType = MET_SHORT\nElementDataFile = LOCAL\n"
        );
        header.into_bytes().into_iter().chain(self.voxels.iter().flat_map(|v| v.to_le_bytes())).collect()
    }
}

/// What the stages up to the tree make of a file, in memory: mask, spheres, tree and ledger as they would be written.
fn tree_of(folder: &Path, bytes: &[u8]) -> [Vec<u8>; 4] {
    let path = folder.join("volume");
    std::fs::write(&path, bytes).expect("writable");
    let mask = read_mask(&path, &ReadOptions::default(), &espalier_volume::Params::default());
    let mask = mask.unwrap_or_else(|error| panic!("{error}")).mask;
    let made = espalier_skeleton::skeletonize(&mask, &espalier_skeleton::Params::default());
    let skeleton = made.expect("a skeleton").skeleton;
    let spheres = espalier_radius::inscribed_spheres(&mask, &skeleton, &espalier_radius::Params::default());
    let spheres = spheres.expect("spheres").spheres;
    let built = espalier_tree::build(&mask, &skeleton, &spheres, &espalier_tree::Params::default());
    let built = built.expect("a tree");
    let texts = [spheres.to_tsv(), swc::write(&built.tree, &[]), built.ledger.to_tsv()];
    let [spheres, tree, ledger] = texts.map(String::into_bytes);
    [nifti_out::mask(&mask).expect("bytes"), spheres, tree, ledger]
}

/// What a run up to the embedding makes of a file: the bytes of each result.
fn results(folder: &Path, bytes: &[u8]) -> Vec<Vec<u8>> {
    let (input, out) = (folder.join("volume"), folder.join("out"));
    std::fs::write(&input, bytes).expect("writable");
    let done = run_range(&input, &out, &small_swarm(), (None, Some(Stage::Embed)));
    done.unwrap_or_else(|error| panic!("{error}"));
    let made = RESULTS.map(|name| std::fs::read(out.join(name)).expect(name)).to_vec();
    std::fs::remove_dir_all(&out).expect("removable");
    made
}

/// All orders of a scan give the same results; those of its mirror image give others.
fn check(scan: &Scan) {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let mirror = scan.clone().mirrored();
    let [expected, mirrored] = [scan, &mirror].map(|scan| tree_of(folder.path(), &scan.nifti()));
    let n_nodes = expected[2].iter().filter(|&&byte| byte == b'\n').count();
    assert!(n_nodes > 10, "a tree of {n_nodes} lines is none");
    assert!(mirrored.iter().zip(&expected).all(|(mirrored, own)| mirrored != own));
    for (index, order) in Order::all().into_iter().enumerate() {
        let stored = order.of(scan);
        assert!(tree_of(folder.path(), &stored.nifti()) == expected, "NIfTI {order:?}");
        assert!(tree_of(folder.path(), &order.of(&mirror).nifti()) == mirrored, "mirrored {order:?}");
        if index % 7 == 0 {
            assert!(tree_of(folder.path(), &stored.nrrd()) == expected, "NRRD {order:?}");
            assert!(tree_of(folder.path(), &stored.metaimage()) == expected, "MetaImage {order:?}");
        }
    }
    // Every file of a run, too.
    let expected = results(folder.path(), &scan.nifti());
    for order in Order::all().into_iter().skip(5).step_by(11) {
        let made = results(folder.path(), &order.of(scan).nifti());
        for ((name, made), expected) in RESULTS.iter().zip(&made).zip(&expected) {
            assert!(made == expected, "{name} of {order:?}");
        }
    }
}

#[test]
fn an_upright_organ() {
    check(&Scan::organ([0.5, 1.0, 0.5], [-16.0, 8.0, 4.0], 0.0));
}

/// Numbers that single precision has not, so that the origin of each order is another rounding away.
#[test]
fn an_organ_of_uneven_spacing_far_from_the_origin() {
    check(&Scan::organ([0.7, 1.1, 0.6], [-216.3, 148.7, -1004.1], 0.0));
}

#[test]
fn an_oblique_organ() {
    check(&Scan::organ([0.5, 1.0, 0.625], [-16.2, 88.4, 4.9], 30.0));
}

/// The masks of a CT in some orders, grown from the seed that each finds, and the radii up to its walls.
fn check_ct(ct: &Scan) {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let path = folder.path().join("volume");
    let params = espalier_volume::Params {
        preset: Some(espalier_volume::Preset::Airway),
        ..espalier_volume::Params::default()
    };
    let grown = |scan: &Scan| -> Mask {
        std::fs::write(&path, scan.nifti()).expect("writable");
        let made = read_mask(&path, &ReadOptions::default(), &params);
        made.unwrap_or_else(|error| panic!("{error}")).mask
    };
    let bytes = |mask: &Mask| nifti_out::mask(mask).expect("bytes");
    let expected = grown(ct);
    assert!(expected.n_foreground() > 1000, "{} voxels", expected.n_foreground());
    for order in Order::all().into_iter().step_by(7) {
        assert!(bytes(&grown(&order.of(ct))) == bytes(&expected), "{order:?}");
    }
    let out = folder.path().join("out");
    let measured = |scan: &Scan| -> [Vec<u8>; 2] {
        std::fs::write(&path, scan.nifti()).expect("writable");
        let done = run_range(&path, &out, &[set("volume.preset", "airway")], (None, Some(Stage::Tree)));
        done.unwrap_or_else(|error| panic!("{error}"));
        let made = ["stages/03-radius/spheres.tsv", "tree.swc"]
            .map(|file| std::fs::read(out.join(file)).expect(file));
        std::fs::remove_dir_all(&out).expect("removable");
        made
    };
    let expected = measured(ct);
    for order in Order::all().into_iter().skip(3).step_by(11) {
        assert!(measured(&order.of(ct)) == expected, "{order:?}");
    }
}

/// A CT file as a scan.
fn read_ct(path: &Path) -> Scan {
    let volume = espalier_volume::read(path, &ReadOptions::default()).expect("a CT").volume;
    let voxels = volume.map_values(|value| value as i16);
    Scan { shape: volume.grid().shape(), affine: volume.grid().world_from_voxel(), voxels }
}

#[test]
fn a_ct_grows_to_one_mask() {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let overrides = [set("phantom.spacing_mm", "[1.5, 1.5, 1.5]"), set("phantom.generations", 3)];
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipelines/airway.toml");
    run_range(&config, folder.path(), &overrides, (None, Some(Stage::Phantom))).expect("a phantom");
    check_ct(&read_ct(&folder.path().join("stages/00-phantom/ct.nii.gz")));
}

#[test]
fn a_real_ct_grows_to_one_mask() {
    let Some(data) = real_data() else { return };
    check_ct(&read_ct(&data.join("volumes/totalseg_pulmonary_ct.nii.gz")));
}
