//! Thick slices of a mask, and what lies between them.
//!
//! **Input** the bits of a mask and its grid. **Output** the same on slices about as far apart as the voxels within them,
//! the old slices among them.
//! **Notation** k new slices to an old one; the distance of a voxel is that to the edge of the mask within its slice,
//! positive inside.
//! **Steps** For each axis whose spacing is large ([`factors`]): 1. the distances in each slice, no larger than the slices
//! are apart, where walls are rough smoothed ([`distance`]); 2. between two slices the distance is interpolated by a
//! cubic through these two and their neighbours; 3. what is above 0 is inside.
//! **Why?** A branch that runs aslant is a staircase of slices, and on slices of 2.5 mm a step is longer than many a branch is
//! wide: axes follow the steps, and twigs are lost among spurs.
//! **Why no larger than the slices are apart?** So far is the next slice: as it is cut off, the distance within the slice is
//! that in space, wherever it decides.
//! **Why at the end?** Islands, cavities and holes are faults of the file's voxels; interpolated they would be rods.
//! **Limits** what lies a voxel or two beside another body in two slices can grow together with it between them: so does a thin
//! branch that crosses from one slice to the next, and the slices do not tell the two apart. Bodies that did are counted.
//! **Guarantees** where walls are smooth, every voxel of the file is as it was; what hung together does so still
//! ([`stitch`]); memory is known before it is taken; the result does not depend on the number of threads.
//! **Effect** phantom vessels at 0.7 × 0.7 × 2.5 mm, four trees: 96.6 % of the tips found, then 99.6; off axis by 0.29 voxel,
//! then 0.24; 1.7 % of the centreline outside of the body, then 0.2; angles at forks wrong by 7.1°, then 5.0°. With 15 % of the
//! surface flipped 95.3 % of the tips, then 97.8; 0.56 voxel, then 0.32; 8.7 %, then 0.8; 11.1°, then 6.5°. Of clean trees one
//! found tip in 200 is false, where none was.
//! **Source** shape-based interpolation [Raya1990]; with cubics [Herman1992].
//! **Differs from the source** distances are exact and cut off; rough walls are smoothed; all is a little wider.
//! **Cost** O(box of the organ · k); memory of some slices and of the new mask.

mod distance;
mod stitch;
mod thin;

use std::ops::Range;

use espalier_model::nifti_out::stored_grid;
use espalier_model::{Bits, Grid, Mask, Report};
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use crate::Error;
use crate::error::check_memory;
use distance::{Section, Wall};
use stitch::{Placed, Stitched};
use thin::thin_branches;

/// New slices to an old one at most.
const MAX_FACTOR: usize = 16;
/// Spacings of single precision are so exact, as a share: 2.0 mm over 0.8 mm is 2.5.
const ROUNDING: f64 = 1e-5;
/// A place is near the mask if its distance is less than this share of the limit.
const NEAR: f64 = 0.99;
/// Old slices that are held at a time.
const BLOCK: i64 = 16;

/// The mask on thinner slices; as it is where none are thick.
///
/// # Errors
/// [`Error`] if the slices need more than `max_bytes`.
pub(crate) fn refine(
    mask: Mask,
    (from_ratio, max_bytes): (f64, u64),
    report: &mut Report,
) -> Result<Mask, Error> {
    let old = mask.grid().clone();
    let factors = factors(&old, from_ratio);
    if factors == [1; 3] {
        return Ok(mask);
    }
    let mut mask = mask;
    let (mut n_rough, mut all) = (0, Stitched::default());
    for (axis, factor) in factors.into_iter().enumerate().filter(|(_, factor)| *factor > 1) {
        let Some(slices) = Slices::of(&mask, axis, factor) else { return Ok(mask) };
        check_memory("interpolating slices", slices.n_bytes(), max_bytes)?;
        let is_rough = slices.wall() == Wall::Rough;
        n_rough += usize::from(is_rough);
        let thin = is_rough.then(|| slices.thin_branches());
        let mut bits = slices.interpolated(thin.as_ref());
        let placed = Placed { axis, factor, first: n_beyond(factor) };
        let stitched = stitch::stitch(mask.bits(), &mut bits, placed);
        all.n_threads += stitched.n_threads;
        all.n_grown_together += stitched.n_grown_together;
        mask = Mask::new(grid_of(mask.grid(), axis, factor)?, bits);
    }
    note((&old, mask.grid()), (n_rough, all.n_grown_together), report);
    report.count_usize("thick_slices_threads", all.n_threads);
    report.count_usize("thick_slices_grown_together", all.n_grown_together);
    Ok(mask)
}

/// How many new slices each axis gets to an old one.
fn factors(grid: &Grid, from_ratio: f64) -> [usize; 3] {
    let spacing = grid.spacing_mm();
    let smallest = spacing.min_element();
    [0, 1, 2].map(|axis| {
        let ratio = spacing[axis] / smallest;
        // A single slice has no next one.
        let is_thick = from_ratio > 0.0 && ratio >= from_ratio * (1.0 - ROUNDING) && grid.shape()[axis] > 1;
        if is_thick { (ratio.round() as usize).clamp(2, MAX_FACTOR) } else { 1 }
    })
}

/// New slices beyond the first and the last old one, so that the box stays about the same.
fn n_beyond(factor: usize) -> usize {
    (factor - 1) / 2
}

fn grid_of(old: &Grid, axis: usize, factor: usize) -> Result<Grid, Error> {
    let mut shape = old.shape();
    shape[axis] = (shape[axis] - 1) * factor + 1 + 2 * n_beyond(factor);
    let (mut scale, mut first) = (DVec3::ONE, DVec3::ZERO);
    scale[axis] = 1.0 / factor as f64;
    first[axis] = -(n_beyond(factor) as f64) / factor as f64;
    let affine = old.world_from_voxel();
    let axes = affine.matrix3 * DMat3::from_diagonal(scale);
    let grid = Grid::new(shape, DAffine3::from_mat3_translation(axes, affine.transform_point3(first)));
    grid.and_then(|grid| stored_grid(&grid)).map_err(Error::Grid)
}

/// The slices of a mask across one axis.
struct Slices<'a> {
    bits: &'a Bits,
    /// The axis across the slices, and the two within.
    axes: [usize; 3],
    factor: usize,
    spacing_mm: [f64; 3],
    /// The first and the last slice with foreground.
    used: [usize; 2],
    /// What of a slice is looked at: first voxel and extents, along the two axes within.
    window: ([usize; 2], [usize; 2]),
}

impl<'a> Slices<'a> {
    /// None of an empty mask.
    fn of(mask: &'a Mask, axis: usize, factor: usize) -> Option<Self> {
        let (first, last) = mask.bits().bounding_box()?;
        let spacing = mask.grid().spacing_mm().to_array();
        let within = [usize::from(axis == 0), if axis == 2 { 1 } else { 2 }];
        let window = within.map(|w| {
            let margin = distance::margin(spacing[axis], spacing[w]);
            let start = first[w].saturating_sub(margin);
            (start, (last[w] + margin + 1).min(mask.grid().shape()[w]) - start)
        });
        Some(Self {
            bits: mask.bits(),
            axes: [axis, within[0], within[1]],
            factor,
            spacing_mm: spacing,
            used: [first[axis], last[axis]],
            window: (window.map(|(start, _)| start), window.map(|(_, extent)| extent)),
        })
    }

    /// The largest distance: to the next slice, and no more than so many voxels, which a search can go through.
    fn limit_mm(&self) -> f64 {
        let [across, u, v] = self.axes.map(|axis| self.spacing_mm[axis]);
        across.min(MAX_FACTOR as f64 * u.min(v))
    }

    fn n_old(&self) -> usize {
        self.bits.shape()[self.axes[0]]
    }

    fn new_shape(&self) -> [usize; 3] {
        let mut shape = self.bits.shape();
        shape[self.axes[0]] = (self.n_old() - 1) * self.factor + 1 + 2 * n_beyond(self.factor);
        shape
    }

    /// What the interpolation holds: the new mask, the distances of a block with the work on them, and what joins pieces.
    fn n_bytes(&self) -> u64 {
        let [nx, ny, nz] = self.new_shape().map(|n| n as u64);
        let new_mask = nx.div_ceil(64).saturating_mul(8).saturating_mul(ny).saturating_mul(nz);
        let in_window = self.window.1[0] as u64 * self.window.1[1] as u64;
        let joining = (self.bits.count() * stitch::BYTES_PER_VOXEL) as u64;
        new_mask.saturating_add(in_window.saturating_mul(16 * (BLOCK as u64 + 3))).saturating_add(joining)
    }

    /// A slice of some bits of the mask's shape.
    fn section(&self, bits: &Bits, slice: usize) -> Section {
        let [across, u, v] = self.axes;
        let (start, extent) = self.window;
        let mut section = Section::empty(extent, [self.spacing_mm[u], self.spacing_mm[v]]);
        if !(self.used[0]..=self.used[1]).contains(&slice) {
            return section;
        }
        let mut voxel = [0; 3];
        voxel[across] = slice;
        for (index, is_inside) in section.inside.iter_mut().enumerate() {
            (voxel[u], voxel[v]) = (start[0] + index % extent[0], start[1] + index / extent[0]);
            *is_inside = bits.get(voxel);
        }
        section
    }

    fn wall(&self) -> Wall {
        let slices = self.used[0]..self.used[1] + 1;
        let counts = slices.into_par_iter().map(|slice| self.section(self.bits, slice).pits_and_walls());
        let [n_pits, n_walls] = counts.reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        Wall::of(n_pits, n_walls)
    }

    /// What smoothing would take of the branches.
    fn thin_branches(&self) -> Bits {
        let limit_mm = self.limit_mm();
        let mut smooth = Bits::new(self.bits.shape());
        let slices = self.used[0]..self.used[1] + 1;
        let outlines: Vec<Vec<u32>> = slices
            .clone()
            .into_par_iter()
            .map(|slice| inside(&self.section(self.bits, slice).smooth_distances(limit_mm)))
            .collect();
        slices.zip(outlines).for_each(|(slice, inside)| self.fill(&mut smooth, slice, &inside));
        thin_branches(self.bits, &smooth, self.axes[0])
    }

    /// The distances in a slice; `thin` are the branches that are to stay in a mask whose walls are rough.
    fn distances(&self, slice: usize, thin: Option<&Bits>) -> Vec<f32> {
        let limit_mm = self.limit_mm();
        let section = self.section(self.bits, slice);
        let Some(thin) = thin else { return section.distances(limit_mm) };
        let mut distances = section.smooth_distances(limit_mm);
        let thin = self.section(thin, slice);
        if thin.inside.contains(&true) {
            let of_thin = thin.distances(limit_mm);
            distances.iter_mut().zip(of_thin).for_each(|(distance, thin)| *distance = distance.max(thin));
        }
        distances
    }

    /// The new mask.
    fn interpolated(&self, thin: Option<&Bits>) -> Bits {
        let mut bits = Bits::new(self.new_shape());
        let [first, last] = self.used.map(|slice| slice as i64);
        let mut from = first - 1;
        while from <= last {
            let to = (from + BLOCK).min(last + 1);
            self.interpolate_block(from..to, thin, &mut bits);
            from = to;
        }
        bits
    }

    /// Fills the new slices from each old one of a block up to the next; −1 stands for what lies before the first.
    fn interpolate_block(&self, block: Range<i64>, thin: Option<&Bits>, bits: &mut Bits) {
        let (limit_mm, last) = (self.limit_mm(), self.n_old() as i64 - 1);
        // Beyond the border the mask goes on as it is there.
        let held: Vec<Vec<f32>> = (block.start - 1..block.end + 2)
            .into_par_iter()
            .map(|slice| self.distances(slice.clamp(0, last) as usize, thin))
            .collect();
        let (factor, beyond) = (self.factor as i64, n_beyond(self.factor) as i64);
        let n_new = bits.shape()[self.axes[0]] as i64;
        let new = (block.start * factor + beyond).max(0)..(block.end * factor + beyond).min(n_new);
        let outlines: Vec<Vec<u32>> = new
            .clone()
            .into_par_iter()
            .map(|new| {
                let (slice, step) = ((new - beyond).div_euclid(factor), (new - beyond).rem_euclid(factor));
                let first = (slice - block.start) as usize;
                between([0, 1, 2, 3].map(|i| &held[first + i][..]), step as f64 / factor as f64, limit_mm)
            })
            .collect();
        new.zip(outlines).for_each(|(new, inside)| self.fill(bits, new as usize, &inside));
    }

    /// Sets the voxels of a slice at these places of the window.
    fn fill(&self, bits: &mut Bits, slice: usize, inside: &[u32]) {
        let [across, u, v] = self.axes;
        let (start, extent) = self.window;
        let mut voxel = [0; 3];
        voxel[across] = slice;
        for &index in inside {
            let index = index as usize;
            (voxel[u], voxel[v]) = (start[0] + index % extent[0], start[1] + index / extent[0]);
            bits.set(voxel);
        }
    }
}

/// The places that are inside.
fn inside(distances: &[f32]) -> Vec<u32> {
    (0..distances.len()).filter(|&place| distances[place] > 0.0).map(|place| place as u32).collect()
}

/// The places that are inside a share of the way from the second of four slices to the third.
fn between(about: [&[f32]; 4], share: f64, limit_mm: f64) -> Vec<u32> {
    // Catmull and Rom's cubic: through the two in the middle, there with the slopes between their neighbours.
    let (t, tt, ttt) = (share, share * share, share * share * share);
    let weights = [
        0.5 * (-t + 2.0 * tt - ttt),
        0.5 * (2.0 - 5.0 * tt + 3.0 * ttt),
        0.5 * (t + 4.0 * tt - 3.0 * ttt),
        0.5 * (ttt - tt),
    ]
    .map(|weight| weight as f32);
    let is_inside = |&place: &usize| {
        let sum: f32 = (0..4).map(|i| weights[i] * about[i][place]).sum();
        sum > 0.0
    };
    // Where neither slice has anything near, there is nothing between them.
    let far = -(NEAR * limit_mm) as f32;
    let is_near = |&place: &usize| about[1][place] > far || about[2][place] > far;
    (0..about[1].len()).filter(is_near).filter(is_inside).map(|place| place as u32).collect()
}

fn note((old, new): (&Grid, &Grid), (n_rough, n_grown_together): (usize, usize), report: &mut Report) {
    let ([ox, oy, oz], [nx, ny, nz]) = (old.shape(), new.shape());
    let (from, to) = (old.spacing_mm(), new.spacing_mm());
    let rough = if n_rough > 0 { ", smoothed within them since their walls are rough" } else { "" };
    let together = match n_grown_together {
        0 => String::new(),
        n => format!("; {n} component(s) grew together with others beside them"),
    };
    report.warn(
        "W-VOLUME-THICK-SLICES",
        format!(
            "thick slices were interpolated by shape{rough}: {ox}x{oy}x{oz} voxels of {:.4} x {:.4} x {:.4} mm are \
             {nx}x{ny}x{nz} of {:.4} x {:.4} x {:.4} mm now{together}; volume.thick_slices = 0 leaves them",
            from.x, from.y, from.z, to.x, to.y, to.z
        ),
    );
    report.count_usize("thick_slices_from_voxels", old.n_voxels());
    report.count_usize("thick_slices_to_voxels", new.n_voxels());
    report.count_usize("thick_slices_rough_axes", n_rough);
}

#[cfg(test)]
mod tests {
    use glam::Vec3Swizzles as _;

    use super::*;
    use crate::flood::random_bits;
    use crate::runs::{Connectivity, Runs};

    const LIMIT: u64 = 1 << 30;

    fn mask(shape: [usize; 3], spacing: [f64; 3], is_inside: impl Fn(DVec3) -> bool) -> Mask {
        let spacing = DVec3::from_array(spacing);
        let grid = Grid::axis_aligned(shape, spacing, DVec3::new(-7.0, 3.5, 11.0)).expect("legal");
        Mask::from_fn(grid, |voxel| is_inside(spacing * DVec3::from_array(voxel.map(|v| v as f64))))
    }

    #[test]
    fn bodies_that_grow_together_are_told() {
        // Two blocks a voxel apart, in two of six slices.
        let is_inside = |p: DVec3| {
            (6.0..=12.0).contains(&p.z)
                && (4.0..=9.0).contains(&p.y)
                && ((3.0..=8.0).contains(&p.x) || (10.0..=15.0).contains(&p.x))
        };
        let (new, report) = refined(&mask([20, 14, 5], [1.0, 1.0, 6.0], is_inside));
        let n_components = Runs::cut(new.bits()).components(Connectivity::All).n_components;
        assert_eq!(n_components, 1);
        assert_eq!(report.get("thick_slices_grown_together"), Some(1.0));
        assert!(report.warnings[0].message.contains("1 component(s) grew together"));
    }

    /// Spacings as files of single precision have them.
    #[test]
    fn the_ratio_of_rounded_spacings_counts() {
        let spacing = [f64::from(0.8_f32), f64::from(0.8_f32), f64::from(2.0_f32)];
        let thick = mask([9, 9, 5], spacing, |p| p.x > 2.0 && p.x < 5.0);
        let new = refine(thick, (2.5, LIMIT), &mut Report::default()).expect("enough memory");
        assert!(new.grid().spacing_mm().z < 1.1);
    }

    fn refined(mask: &Mask) -> (Mask, Report) {
        let mut report = Report::default();
        (refine(mask.clone(), (1.5, LIMIT), &mut report).expect("enough memory"), report)
    }

    /// Whether a point lies in a tube of radius 3 about a line that leads aslant through the slices.
    fn is_in_tube(point: DVec3) -> bool {
        let along = DVec3::new(0.8, 0.2, 0.55).normalize();
        let off = point - DVec3::new(4.0, 14.0, 8.0);
        let share = off.dot(along).clamp(4.0, 40.0);
        (off - along * share).length() <= 3.0
    }

    #[test]
    fn an_oblique_tube_loses_its_steps() {
        let tube = mask([48, 32, 12], [1.0, 1.0, 4.0], is_in_tube);
        let (fine, report) = refined(&tube);
        assert_eq!(fine.grid().shape(), [48, 32, 47]);
        assert!((fine.grid().spacing_mm() - DVec3::ONE).abs().max_element() < 1e-9);
        let n_wrong = |is_inside: &dyn Fn(DVec3) -> bool| {
            let grid = fine.grid();
            let of_voxel = |index: usize| {
                let voxel = DVec3::from_array(grid.voxel(index).map(|v| v as f64));
                grid.world_from_voxel().transform_point3(voxel)
            };
            let origin = DVec3::new(-7.0, 3.5, 11.0);
            (0..grid.n_voxels())
                .filter(|&i| is_inside(of_voxel(i)) != is_in_tube(of_voxel(i) - origin))
                .count()
        };
        let inside = |mask: &Mask, point: DVec3| {
            let voxel = (mask.grid().voxel_from_world().transform_point3(point) + 0.5).floor();
            mask.bits().contains(voxel.to_array().map(|v| v as i64))
        };
        let (before, after) =
            (n_wrong(&|point| inside(&tube, point)), n_wrong(&|point| inside(&fine, point)));
        assert!(after * 9 < before * 5, "{before} of {} voxels wrong, then {after}", fine.n_foreground());
        assert_eq!(report.warnings[0].code, "W-VOLUME-THICK-SLICES");
        assert_eq!(report.get("thick_slices_rough_axes"), Some(0.0));
    }

    /// What a tube is does not depend on the axis across the slices.
    #[test]
    fn every_axis_may_be_the_thick_one() {
        let (along_z, _) = refined(&mask([48, 32, 12], [1.0, 1.0, 4.0], is_in_tube));
        let (along_x, _) = refined(&mask([12, 32, 48], [4.0, 1.0, 1.0], |p| is_in_tube(p.zyx())));
        let (along_y, _) = refined(&mask([48, 12, 32], [1.0, 4.0, 1.0], |p| is_in_tube(p.xzy())));
        let turned = |mask: &Mask, turn: [usize; 3]| {
            let mut voxels: Vec<_> = mask.voxels().map(|v| turn.map(|axis| v[axis])).collect();
            voxels.sort_unstable_by_key(|&[x, y, z]| [z, y, x]);
            voxels
        };
        let expected = turned(&along_z, [0, 1, 2]);
        assert_eq!(turned(&along_x, [2, 1, 0]), expected);
        assert_eq!(turned(&along_y, [0, 2, 1]), expected);
        let (twice, _) = refined(&mask([48, 8, 12], [1.0, 4.0, 4.0], is_in_tube));
        assert_eq!(twice.grid().shape(), [48, 31, 47]);
        let share = twice.n_foreground() as f64 / expected.len() as f64;
        assert!((0.9..1.1).contains(&share), "{share}");
    }

    /// Noise has every corner and single voxel that there is.
    #[test]
    fn old_voxels_stay_and_hang_together() {
        let pieces = |bits: &Bits| Runs::cut(bits).components(Connectivity::All).n_components;
        let mut n_threads = 0;
        for case in 0..300 {
            let bits = random_bits(case);
            let axis = case as usize % 3;
            let mut spacing = DVec3::ONE;
            spacing[axis] = 2.0 + f64::from(case as u32 % 5);
            let grid = Grid::axis_aligned(bits.shape(), spacing, DVec3::ZERO).expect("legal");
            let mask = Mask::new(grid.clone(), bits);
            let factor = factors(&grid, 1.5)[axis];
            let Some(slices) = Slices::of(&mask, axis, factor).filter(|_| factor > 1) else { continue };
            let placed = Placed { axis, factor, first: n_beyond(factor) };
            let mut fine = slices.interpolated(None);
            stitch::stitch(mask.bits(), &mut fine, placed);
            assert!(pieces(&fine) <= pieces(mask.bits()), "case {case}");
            let mut smooth = slices.interpolated(Some(&slices.thin_branches()));
            n_threads += stitch::stitch(mask.bits(), &mut smooth, placed).n_threads;
            for index in 0..grid.n_voxels() {
                let voxel = grid.voxel(index);
                let mut there = voxel;
                there[axis] = voxel[axis] * factor + n_beyond(factor);
                if mask.bits().get(voxel) {
                    assert!(fine.get(there), "case {case} {voxel:?}");
                }
            }
        }
        assert!(n_threads > 20, "{n_threads}");
    }

    /// A branch one voxel wide beside a rough block: smoothing would take it.
    #[test]
    fn thin_branches_survive_smoothing() {
        let rough =
            |x: usize, y: usize| !(x + 2 * y).is_multiple_of(5) || (x > 2 && x < 10 && y > 3 && y < 17);
        let grid = Grid::axis_aligned([30, 22, 6], DVec3::new(1.0, 1.0, 3.0), DVec3::ZERO).expect("legal");
        let mask = Mask::from_fn(grid, |[x, y, z]| {
            let is_block = (1..12).contains(&x) && (2..19).contains(&y) && rough(x, y);
            (1..5).contains(&z) && (is_block || (x >= 10 && y == 10 && z == 2 && x < 28))
        });
        let (fine, report) = refined(&mask);
        assert_eq!(report.get("thick_slices_rough_axes"), Some(1.0));
        assert!((10..28).all(|x| fine.bits().get([x, 10, 7])));
        assert_eq!(Runs::cut(fine.bits()).components(Connectivity::All).n_components, 1);
    }

    #[test]
    fn thin_slices_and_single_ones_are_left() {
        let all = |_: DVec3| true;
        for (shape, spacing) in [([6, 5, 4], [1.0, 1.0, 1.4]), ([6, 5, 1], [1.0, 1.0, 5.0])] {
            let mask = mask(shape, spacing, all);
            let (same, report) = refined(&mask);
            assert!(same == mask && report.warnings.is_empty(), "{shape:?}");
        }
        let thick = mask([6, 5, 4], [1.0, 1.0, 5.0], all);
        let mut report = Report::default();
        assert_eq!(refine(thick.clone(), (0.0, LIMIT), &mut report).expect("nothing to do"), thick);
        let (fine, _) = refined(&thick);
        // What the border cuts off goes on to it.
        assert_eq!((fine.grid().shape(), fine.n_foreground()), ([6, 5, 20], 600));
    }

    #[test]
    fn memory_is_known_before_it_is_taken() {
        let thick = mask([600, 500, 40], [0.01, 0.01, 1e3], |p| p.x < 3.0);
        let result = refine(thick, (1.5, 1 << 20), &mut Report::default());
        assert!(matches!(result, Err(Error::TooLarge { what: "interpolating slices", .. })), "{result:?}");
    }
}
