//! Slices in order, and whether they are an even stack.
//!
//! **Input** the slices of one series. **Output** [`Stack`]: by position along the normal, and what is irregular.
//! **Notation** p_i the position of slice i along the normal of the images, n slices.
//! **Steps** 1. sort by p_i; 2. several images of one place: dropped if they are the same, else refused; 3. the
//! distances: p_i against p_0 + i (p_{n-1} - p_0) / (n - 1); slices are missing where all distances are whole
//! multiples of the usual one; 4. the first pixels against the line along the normal: a tilted gantry moves each
//! slice aside by the same step.
//! **Guarantees** nothing is taken from `SliceThickness`, `SpacingBetweenSlices` or `GantryDetectorTilt`, which are
//! often wrong; only the positions count.

use espalier_geom::math;
use glam::{DVec2, DVec3};

use super::error::{DicomError, Irregularity};
use super::header::Slice;
use super::pixels;
use super::series::Image;

/// Images nearer than this along the normal are of one place: no scanner cuts thinner slices.
const SAME_PLACE_MM: f64 = 0.01;
/// How far a slice may be from its even place: positions are often written with one decimal, which is 0.05 mm, …
const MAX_OFF_MM: f64 = 0.05;
/// … and a fiftieth of the distance is nothing that interpolation could mend.
const MAX_OFF_SHARE: f64 = 0.02;
/// The largest tangent of the tilt that still counts as none: the same as for other formats' axes.
const MAX_TILT: f64 = 1e-3;
/// Slices are missing if distances are multiples of the usual one to this share.
const MAX_MULTIPLE_ERROR: f64 = 0.1;

/// Slices in order.
pub(super) struct Stack {
    /// Upwards along the normal; at least two.
    pub(super) images: Vec<Image>,
    /// The position of each along the normal, from the first, in mm.
    pub(super) heights: Vec<f64>,
    /// How far each is aside of the first along its axes, in mm.
    pub(super) offsets: Vec<DVec2>,
    pub(super) irregularity: Irregularity,
    pub(super) n_duplicates: usize,
}

fn normal(slice: &Slice) -> DVec3 {
    slice.axes[0].cross(slice.axes[1])
}

fn height(slice: &Slice, normal: DVec3) -> f64 {
    slice.position.dot(normal)
}

/// Whether two of the slices lie at one place.
pub(super) fn has_shared_places(slices: &[&Slice]) -> bool {
    sorted_distances(slices).first().is_some_and(|&smallest| smallest < SAME_PLACE_MM)
}

/// The median distance between neighbours; NaN for one slice.
pub(super) fn usual_distance(slices: &[&Slice]) -> f64 {
    let distances = sorted_distances(slices);
    distances.get(distances.len() / 2).copied().unwrap_or(f64::NAN)
}

fn sorted_distances(slices: &[&Slice]) -> Vec<f64> {
    let Some(first) = slices.first() else { return Vec::new() };
    let normal = normal(first);
    let mut heights: Vec<f64> = slices.iter().map(|slice| height(slice, normal)).collect();
    heights.sort_by(f64::total_cmp);
    let mut distances: Vec<f64> = heights.windows(2).map(|pair| pair[1] - pair[0]).collect();
    distances.sort_by(f64::total_cmp);
    distances
}

/// Puts slices in order.
pub(super) fn order(mut images: Vec<Image>, max_bytes: u64) -> Result<Stack, DicomError> {
    let first = images.first().ok_or(DicomError::SingleSlice)?;
    let normal = normal(&first.slice);
    images.sort_by(|a, b| {
        let by_height = height(&a.slice, normal).total_cmp(&height(&b.slice, normal));
        by_height.then_with(|| a.path.cmp(&b.path))
    });
    let n_before = images.len();
    let images = drop_duplicates(images, normal, max_bytes)?;
    let n_duplicates = n_before - images.len();
    if images.len() < 2 {
        return Err(DicomError::SingleSlice);
    }

    let origin = images[0].slice.position;
    let [x, y] = images[0].slice.axes;
    let from_first = |image: &Image| image.slice.position - origin;
    let heights: Vec<f64> = images.iter().map(|image| from_first(image).dot(normal)).collect();
    let offsets: Vec<DVec2> =
        images.iter().map(|image| DVec2::new(from_first(image).dot(x), from_first(image).dot(y))).collect();
    let mut irregularity = Irregularity::default();
    check_distances(&heights, origin.dot(normal), &mut irregularity);
    check_offsets(&heights, &offsets, &mut irregularity);
    Ok(Stack { images, heights, offsets, irregularity, n_duplicates })
}

/// Drops images of one place that are the same.
fn drop_duplicates(images: Vec<Image>, normal: DVec3, max_bytes: u64) -> Result<Vec<Image>, DicomError> {
    let mut kept: Vec<Image> = Vec::with_capacity(images.len());
    let mut differing: Vec<f64> = Vec::new();
    for image in images {
        let here = height(&image.slice, normal);
        match kept.last() {
            Some(last) if here - height(&last.slice, normal) < SAME_PLACE_MM => {
                if !is_same(last, &image, max_bytes)
                    && differing.last().is_none_or(|&p| here - p > SAME_PLACE_MM)
                {
                    differing.push(here);
                }
            }
            _ => kept.push(image),
        }
    }
    match differing.first() {
        Some(&position) => Err(DicomError::Duplicates { n: differing.len(), position }),
        None => Ok(kept),
    }
}

fn is_same(a: &Image, b: &Image, max_bytes: u64) -> bool {
    let is_aligned = a.slice.position.abs_diff_eq(b.slice.position, SAME_PLACE_MM);
    let is_scaled_alike = a.slice.slope == b.slice.slope && a.slice.intercept == b.slice.intercept;
    let pixels = |image: &Image| (image.path.clone(), image.slice.stored);
    let ((path_a, stored_a), (path_b, stored_b)) = (pixels(a), pixels(b));
    is_aligned && is_scaled_alike && pixels::are_equal((&path_a, &stored_a), (&path_b, &stored_b), max_bytes)
}

fn check_distances(heights: &[f64], first_position: f64, irregularity: &mut Irregularity) {
    let distances: Vec<f64> = heights.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = distances.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    let step = heights[heights.len() - 1] / distances.len() as f64;
    let off =
        heights.iter().enumerate().map(|(i, height)| (height - i as f64 * step).abs()).fold(0.0, f64::max);
    if off <= MAX_OFF_MM.max(MAX_OFF_SHARE * usual) {
        return;
    }
    let multiple = |distance: f64| (distance / usual).round();
    let is_multiple = |&distance: &f64| {
        multiple(distance) >= 1.0 && (distance / usual - multiple(distance)).abs() < MAX_MULTIPLE_ERROR
    };
    if distances.iter().all(is_multiple) && distances.iter().any(|&distance| multiple(distance) > 1.0) {
        let gaps = distances.iter().enumerate().filter(|&(_, &distance)| multiple(distance) > 1.0);
        irregularity.missing = gaps
            .map(|(i, &distance)| (multiple(distance) as usize - 1, i + 1, first_position + heights[i]))
            .collect();
    } else {
        irregularity.uneven = Some([sorted[0], usual, sorted[sorted.len() - 1], off]);
    }
}

fn check_offsets(heights: &[f64], offsets: &[DVec2], irregularity: &mut Irregularity) {
    let last = heights.len() - 1;
    let slope = offsets[last] / heights[last];
    let tangent = slope.length();
    if tangent > MAX_TILT {
        let step = heights[last] / last as f64;
        irregularity.tilt = Some((math::atan2(tangent, 1.0).to_degrees(), tangent * step));
    }
    let aside = heights.iter().zip(offsets).map(|(&height, &offset)| (offset - slope * height).length());
    let aside = aside.fold(0.0, f64::max);
    if aside > MAX_OFF_MM {
        irregularity.aside_mm = Some(aside);
    }
}
