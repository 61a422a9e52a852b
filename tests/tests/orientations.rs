//! A volume's orientation in its file does not matter: one phantom in 48 orientations and three formats gives one
//! skeleton in the world, and its mirror image another.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::path::Path;

use espalier_volume::{ReadOptions, read_mask};
use glam::{DAffine3, DMat3, DVec3};

/// Voxels of the phantom along R, A, S.
const SHAPE: [usize; 3] = [24, 20, 30];
/// Powers of two, so that no orientation rounds another way.
const SPACING_MM: [f64; 3] = [0.5, 1.0, 0.5];

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

/// One way to store the phantom: which world axis each voxel axis runs along, and whether forwards.
#[derive(Clone, Copy, Debug)]
struct Stored {
    axes: [usize; 3],
    is_forward: [bool; 3],
}

impl Stored {
    fn all() -> Vec<Self> {
        let permutations = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let signs = (0..8_u32).map(|bits| [0, 1, 2].map(|axis| bits >> axis & 1 == 0));
        signs.flat_map(|is_forward| permutations.map(|axes| Self { axes, is_forward })).collect()
    }

    fn shape(self) -> [usize; 3] {
        self.axes.map(|axis| SHAPE[axis])
    }

    /// RAS+ mm from the voxels of the file.
    fn affine(self) -> DAffine3 {
        let (mut columns, mut origin) = ([DVec3::ZERO; 3], DVec3::new(-16.0, 8.0, 4.0));
        for (voxel_axis, &axis) in self.axes.iter().enumerate() {
            let mut step = DVec3::ZERO;
            step[axis] = SPACING_MM[axis];
            if !self.is_forward[voxel_axis] {
                origin += step * (SHAPE[axis] - 1) as f64;
                step = -step;
            }
            columns[voxel_axis] = step;
        }
        DAffine3::from_mat3_translation(DMat3::from_cols(columns[0], columns[1], columns[2]), origin)
    }

    /// The bytes of the voxels, 0 and 1.
    fn voxels(self, is_mirrored: bool) -> Vec<u8> {
        let [nx, ny, nz] = self.shape();
        let mut bytes = Vec::with_capacity(nx * ny * nz);
        for index in 0..nx * ny * nz {
            let voxel = [index % nx, index / nx % ny, index / (nx * ny)];
            let mut world = [0; 3];
            for (voxel_axis, &axis) in self.axes.iter().enumerate() {
                let along = voxel[voxel_axis];
                world[axis] = if self.is_forward[voxel_axis] { along } else { SHAPE[axis] - 1 - along };
            }
            if is_mirrored {
                world[0] = SHAPE[0] - 1 - world[0];
            }
            bytes.push(u8::from(is_organ(world)));
        }
        bytes
    }

    fn nifti(self, is_mirrored: bool) -> Vec<u8> {
        let mut bytes = vec![0_u8; 352];
        let mut put =
            |offset: usize, field: &[u8]| bytes[offset..offset + field.len()].copy_from_slice(field);
        put(0, &348_i32.to_le_bytes());
        put(40, &3_i16.to_le_bytes());
        for (axis, extent) in self.shape().into_iter().enumerate() {
            put(42 + 2 * axis, &(extent as i16).to_le_bytes());
            put(80 + 4 * axis, &(SPACING_MM[self.axes[axis]] as f32).to_le_bytes());
        }
        put(70, &2_i16.to_le_bytes());
        put(72, &8_i16.to_le_bytes());
        put(108, &352_f32.to_le_bytes());
        put(123, &[2]);
        put(254, &1_i16.to_le_bytes());
        let affine = self.affine();
        for row in 0..3 {
            let columns = [affine.x_axis, affine.y_axis, affine.z_axis, affine.translation];
            for (column, vector) in columns.into_iter().enumerate() {
                put(280 + 16 * row + 4 * column, &(vector[row] as f32).to_le_bytes());
            }
        }
        put(344, b"n+1\0");
        bytes.extend(self.voxels(is_mirrored));
        bytes
    }

    /// The axes and the origin in LPS.
    fn lps(self) -> [DVec3; 4] {
        let affine = self.affine();
        [affine.x_axis, affine.y_axis, affine.z_axis, affine.translation]
            .map(|v| v * DVec3::new(-1.0, -1.0, 1.0))
    }

    fn nrrd(self, is_mirrored: bool) -> Vec<u8> {
        let vector = |v: DVec3| format!("({},{},{})", v.x, v.y, v.z);
        let ([nx, ny, nz], [x, y, z, origin]) = (self.shape(), self.lps().map(vector));
        let header = format!(
            "NRRD0004\ntype: uchar\ndimension: 3\nspace: left-posterior-superior\nsizes: {nx} {ny} {nz}\n\
             space directions: {x} {y} {z}\nencoding: raw\nspace origin: {origin}\n\n"
        );
        [header.into_bytes(), self.voxels(is_mirrored)].concat()
    }

    fn metaimage(self, is_mirrored: bool) -> Vec<u8> {
        let [x, y, z, origin] = self.lps();
        let vector = |v: DVec3| format!("{} {} {}", v.x, v.y, v.z);
        let ([nx, ny, nz], spacing) = (self.shape(), self.axes.map(|axis| SPACING_MM[axis]));
        let rows = [x / spacing[0], y / spacing[1], z / spacing[2]].map(vector).join(" ");
        let (spacing, origin) = (vector(DVec3::from_array(spacing)), vector(origin));
        let header = format!(
            "ObjectType = Image\nNDims = 3\nTransformMatrix = {rows}\nOffset = {origin}\nElementSpacing = {spacing}\n\
             DimSize = {nx} {ny} {nz}\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n"
        );
        [header.into_bytes(), self.voxels(is_mirrored)].concat()
    }
}

/// The skeleton of a volume file in RAS+ mm, every setting at its default: its voxel centres, sorted.
fn skeleton(path: &Path, bytes: &[u8]) -> Vec<[f64; 3]> {
    std::fs::write(path, bytes).expect("writable");
    let mask = read_mask(path, &ReadOptions::default(), &espalier_volume::Params::default());
    let mask = mask.unwrap_or_else(|error| panic!("{error}")).mask;
    let made = espalier_skeleton::skeletonize(&mask, &espalier_skeleton::Params::default());
    let world_from_voxel = mask.grid().world_from_voxel();
    let place = |voxel: &[u32; 3]| {
        world_from_voxel.transform_point3(DVec3::from_array(voxel.map(f64::from))).to_array()
    };
    let mut centres: Vec<[f64; 3]> = made.expect("a skeleton").skeleton.voxels().iter().map(place).collect();
    centres.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2])));
    centres
}

#[test]
fn orientation_and_format_do_not_matter_but_mirrors_do() {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let path = folder.path().join("volume");
    let orientations = Stored::all();
    assert_eq!(orientations.len(), 48);
    let expected = skeleton(&path, &orientations[0].nifti(false));
    assert!(expected.len() > 30, "{} voxels are no tree", expected.len());
    for (index, stored) in orientations.iter().enumerate() {
        assert!(skeleton(&path, &stored.nifti(false)) == expected, "NIfTI {stored:?}");
        if index % 7 == 0 {
            assert!(skeleton(&path, &stored.nrrd(false)) == expected, "NRRD {stored:?}");
            assert!(skeleton(&path, &stored.metaimage(false)) == expected, "MetaImage {stored:?}");
        }
    }
    let mirrored = skeleton(&path, &orientations[0].nifti(true));
    assert_ne!(mirrored, expected);
    for stored in orientations.iter().step_by(5) {
        assert!(skeleton(&path, &stored.nifti(true)) == mirrored, "mirrored {stored:?}");
    }
}
