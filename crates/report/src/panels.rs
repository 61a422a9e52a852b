//! Where slices lie: three planes of the body, as radiologists hang them.
//!
//! **Input** a mask. **Output** for each plane a [`Strip`] of [`N_SLICES`] equal panels about the mask.
//! **Steps** 1. The box of the mask in the world, with a margin. 2. Slices at quantiles of the mask's volume along the
//! normal, so that each has something of it. 3. One scale for all.
//! **Guarantees** a function of the mask alone: the slices of the scan, drawn earlier, lie under the contours.
//! **Cost** O(foreground).

use espalier_model::{Grid, Mask};
use glam::{DVec2, DVec3};

/// Slices of each plane.
pub(crate) const N_SLICES: usize = 4;
/// Where they lie, as shares of the mask's volume.
const QUANTILES: [f64; N_SLICES] = [0.1, 0.37, 0.63, 0.9];
/// Pixels along the longest side of the box.
const LONG_SIDE_PX: f64 = 230.0;
/// Room around the mask, as a share of the longest side.
const MARGIN: f64 = 0.1;
/// Steps along a normal in which volume is counted.
const N_STEPS: usize = 1024;

/// A plane of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Plane {
    /// Seen from the feet, the patient's right on the left.
    Axial,
    /// Seen from the front, the patient's right on the left.
    Coronal,
    /// Seen from the patient's left, the front on the left.
    Sagittal,
}

impl Plane {
    pub(crate) const ALL: [Self; 3] = [Self::Axial, Self::Coronal, Self::Sagittal];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Axial => "axial",
            Self::Coronal => "coronal",
            Self::Sagittal => "sagittal",
        }
    }

    /// What is right and what is up in the picture, RAS+.
    pub(crate) fn axes(self) -> [DVec3; 2] {
        match self {
            Self::Axial => [DVec3::NEG_X, DVec3::Y],
            Self::Coronal => [DVec3::NEG_X, DVec3::Z],
            Self::Sagittal => [DVec3::NEG_Y, DVec3::Z],
        }
    }

    /// Along which coordinate its slices follow each other.
    pub(crate) fn normal(self) -> DVec3 {
        match self {
            Self::Axial => DVec3::Z,
            Self::Coronal => DVec3::Y,
            Self::Sagittal => DVec3::X,
        }
    }

    /// The letters at the left, the right, the upper and the lower edge.
    pub(crate) fn letters(self) -> [&'static str; 4] {
        match self {
            Self::Axial => ["R", "L", "A", "P"],
            Self::Coronal => ["R", "L", "S", "I"],
            Self::Sagittal => ["A", "P", "S", "I"],
        }
    }

    /// A point of the world as the picture shows it, mm: x to the right, y up.
    pub(crate) fn project(self, point_mm: DVec3) -> DVec2 {
        let [right, up] = self.axes();
        DVec2::new(point_mm.dot(right), point_mm.dot(up))
    }
}

/// Equal panels beside each other.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Strip {
    pub(crate) plane: Plane,
    /// Where each slice lies along the normal, RAS+ mm.
    pub(crate) at_mm: Vec<f64>,
    /// Width and height of a panel in pixels.
    pub(crate) size_px: [usize; 2],
    /// Size of a pixel.
    pub(crate) px_mm: f64,
    /// The centre of the upper left pixel, as the plane projects it.
    corner_mm: DVec2,
}

impl Strip {
    /// The point of the world at a pixel of a panel.
    pub(crate) fn point_mm(&self, panel: usize, [column, row]: [usize; 2]) -> DVec3 {
        let [right, up] = self.plane.axes();
        let in_plane = self.corner_mm + self.px_mm * DVec2::new(column as f64, -(row as f64));
        in_plane.x * right + in_plane.y * up + self.at_mm[panel] * self.plane.normal()
    }

    /// Width and height of the whole in pixels.
    pub(crate) fn total_px(&self) -> [usize; 2] {
        [self.size_px[0] * self.at_mm.len(), self.size_px[1]]
    }
}

/// The strips of a mask; none of an empty one.
pub(crate) fn strips(mask: &Mask) -> Option<[Strip; 3]> {
    let [low, high] = world_box(mask)?;
    let extent = high - low;
    let px_mm = (extent.max_element() / LONG_SIDE_PX).max(f64::MIN_POSITIVE);
    let room_mm = MARGIN * extent.max_element();
    Some(Plane::ALL.map(|plane| {
        let corners = [plane.project(low), plane.project(high)];
        let (least, most) = (corners[0].min(corners[1]) - room_mm, corners[0].max(corners[1]) + room_mm);
        let size_px = ((most - least) / px_mm).to_array().map(|side| (side as usize).max(1));
        let corner_mm = DVec2::new(least.x + 0.5 * px_mm, most.y - 0.5 * px_mm);
        let range = [low.dot(plane.normal()), high.dot(plane.normal())];
        Strip { plane, at_mm: quantiles(mask, plane.normal(), range), size_px, px_mm, corner_mm }
    }))
}

/// The box of the foreground in the world, voxels whole.
pub(crate) fn world_box(mask: &Mask) -> Option<[DVec3; 2]> {
    let (low, high) = mask.bits().bounding_box()?;
    let corner = |index: usize, axis: usize| {
        if index >> axis & 1 == 0 { low[axis] as f64 - 0.5 } else { high[axis] as f64 + 0.5 }
    };
    let affine = mask.grid().world_from_voxel();
    let corners = (0..8).map(|index| {
        affine.transform_point3(DVec3::new(corner(index, 0), corner(index, 1), corner(index, 2)))
    });
    let nothing = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    Some(corners.fold(nothing, |[least, most], point| [least.min(point), most.max(point)]))
}

/// Where the shares [`QUANTILES`] of the mask's volume lie along a normal.
fn quantiles(mask: &Mask, normal: DVec3, [low, high]: [f64; 2]) -> Vec<f64> {
    let step = (high - low) / N_STEPS as f64;
    let mut counts = vec![0_usize; N_STEPS];
    for voxel in mask.bits().voxels() {
        let along = center_mm(mask.grid(), voxel).dot(normal);
        counts[(((along - low) / step) as usize).min(N_STEPS - 1)] += 1;
    }
    let n_voxels: usize = counts.iter().sum();
    let place = |share: f64| {
        let mut passed = 0;
        let wanted = share * n_voxels as f64;
        let found = counts.iter().position(|&count| {
            passed += count;
            passed as f64 >= wanted
        });
        low + step * (found.unwrap_or(0) as f64 + 0.5)
    };
    QUANTILES.map(place).to_vec()
}

/// The centre of a voxel, RAS+ mm.
pub(crate) fn center_mm(grid: &Grid, voxel: [usize; 3]) -> DVec3 {
    grid.world_from_voxel().transform_point3(DVec3::from_array(voxel.map(|index| index as f64)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_go_through_the_mask_and_hold_it() {
        let grid = Grid::axis_aligned([40, 30, 50], DVec3::new(0.5, 1.0, 2.0), DVec3::new(-9.0, 4.0, 7.0))
            .expect("a grid");
        let mask = Mask::from_fn(grid, |[x, y, z]| (5..20).contains(&x) && y == 12 && (3..40).contains(&z));
        let strips = strips(&mask).expect("strips");
        let grid = mask.grid();
        for strip in &strips {
            let [width, height] = strip.size_px;
            for panel in 0..N_SLICES {
                let inside = |column: usize, row: usize| {
                    let voxel =
                        grid.voxel_from_world().transform_point3(strip.point_mm(panel, [column, row]));
                    grid.voxel_at(voxel).is_some_and(|voxel| mask.bits().get(voxel))
                };
                let n_inside = (0..width).flat_map(|c| (0..height).map(move |r| (c, r)));
                assert!(n_inside.filter(|&(c, r)| inside(c, r)).count() > 0, "{:?}", strip.plane);
            }
        }
        assert!(super::strips(&Mask::empty(grid.clone())).is_none());
    }
}
