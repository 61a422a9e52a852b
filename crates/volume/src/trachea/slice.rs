//! What looks like a trachea in one axial slice.
//!
//! **Input** a slice of a CT in HU. **Output** the pieces of air that have the area of a trachea and the shape of an
//! ellipse, with a wall about them and tissue before and behind.
//! **Cost** O(pixels).

use espalier_geom::math;
use espalier_model::Volume;

use super::Axes;

/// Air is below this, lung included; both sides of a wall that a voxel shows at all are not. HU.
const AIR_HU: f64 = -700.0;
/// Tissue, fat included, is above this. HU.
const TISSUE_HU: f64 = -250.0;
/// Cross-sections of tracheas, in mm²: a diameter of 5 mm at birth, of 27 mm in large men, some more when oblique.
const AREA_MM2: [f64; 2] = [20.0, 900.0];
/// The most that a trachea's cross-section is longer than wide.
const MAX_ELONGATION: f64 = 2.2;
/// The least share of the ellipse with the same moments that the cross-section fills.
const MIN_FILL: f64 = 0.85;
/// Tissue before and behind, in mm.
const MIN_TISSUE_MM: f64 = 8.0;
/// In how many directions its wall is looked for, how far from it, and the least share that must find one.
const N_RAYS: usize = 16;
const WALL_MM: f64 = 4.0;
const WALL_HU: f64 = -500.0;
const MIN_WALLED: f64 = 0.6;
/// An axial slice: u to the right, v to the front, u fastest, however the scan is stored.
pub(super) struct Slice {
    depth: usize,
    shape: [usize; 2],
    pixel_mm: [f64; 2],
    values: Vec<f32>,
}

impl Slice {
    pub(super) fn read(volume: &Volume, axes: Axes, depth: usize) -> Self {
        let [nu, nv] = [axes.shape[axes.side], axes.shape[axes.front]];
        let value = |place| volume.value(volume.grid().index(axes.voxel(place, depth))) as f32;
        let values = (0..nu * nv).map(|pixel| value([pixel % nu, pixel / nu])).collect();
        Self { depth, shape: [nu, nv], pixel_mm: axes.pixel_mm(), values }
    }

    fn value(&self, [u, v]: [usize; 2]) -> f64 {
        f64::from(self.values[v * self.shape[0] + u])
    }

    fn is_air(&self, pixel: usize) -> bool {
        f64::from(self.values[pixel]) <= AIR_HU
    }
}

/// A piece of air of one slice that looks like a trachea.
pub(super) struct Blob {
    pub(super) depth: usize,
    pub(super) centre: [f64; 2],
    pub(super) area_mm2: f64,
    pub(super) elongation: f64,
    pub(super) walled: f64,
    /// The darkest pixel near the centre.
    pub(super) seed: [usize; 2],
}

impl Blob {
    pub(super) fn diameter_mm(&self) -> f64 {
        (4.0 * self.area_mm2 / std::f64::consts::PI).sqrt()
    }
}

/// The pieces of air of a slice that look like a trachea, in storage order.
pub(super) fn blobs_of(slice: &Slice) -> Vec<Blob> {
    let mut is_seen = vec![false; slice.values.len()];
    let mut blobs = Vec::new();
    for start in 0..is_seen.len() {
        if slice.is_air(start) && !is_seen[start] {
            let pixels = piece(slice, start, &mut is_seen);
            blobs.extend(measure(slice, &pixels));
        }
    }
    blobs
}

/// The 4-connected piece of air about a pixel.
fn piece(slice: &Slice, start: usize, is_seen: &mut [bool]) -> Vec<usize> {
    let [nu, nv] = slice.shape;
    let mut pixels = vec![start];
    is_seen[start] = true;
    let mut next = 0;
    while let Some(&pixel) = pixels.get(next) {
        next += 1;
        let (u, v) = (pixel % nu, pixel / nu);
        let neighbours = [
            (u > 0).then(|| pixel - 1),
            (u + 1 < nu).then(|| pixel + 1),
            (v > 0).then(|| pixel - nu),
            (v + 1 < nv).then(|| pixel + nu),
        ];
        for other in neighbours.into_iter().flatten() {
            if !is_seen[other] && slice.is_air(other) {
                is_seen[other] = true;
                pixels.push(other);
            }
        }
    }
    pixels
}

/// The blob of a piece of air, if it looks like a trachea.
fn measure(slice: &Slice, pixels: &[usize]) -> Option<Blob> {
    let [nu, nv] = slice.shape;
    let [du, dv] = slice.pixel_mm;
    let area_mm2 = pixels.len() as f64 * du * dv;
    let place = |pixel: usize| [pixel % nu, pixel / nu];
    let at_border = |[u, v]: [usize; 2]| u == 0 || v == 0 || u + 1 == nu || v + 1 == nv;
    if !(AREA_MM2[0]..=AREA_MM2[1]).contains(&area_mm2) || pixels.iter().any(|&p| at_border(place(p))) {
        return None;
    }
    let n = pixels.len() as f64;
    let mean = |of: &dyn Fn([f64; 2]) -> f64| {
        pixels.iter().map(|&pixel| of(place(pixel).map(|v| v as f64))).sum::<f64>() / n
    };
    let centre = [mean(&|[u, _]| u), mean(&|[_, v]| v)];
    // Second moments in mm², with a pixel's own.
    let uu = (mean(&|[u, _]| (u - centre[0]) * (u - centre[0])) + 1.0 / 12.0) * du * du;
    let vv = (mean(&|[_, v]| (v - centre[1]) * (v - centre[1])) + 1.0 / 12.0) * dv * dv;
    let uv = mean(&|[u, v]| (u - centre[0]) * (v - centre[1])) * du * dv;
    let (half, gap) = ((uu + vv) / 2.0, ((uu - vv) * (uu - vv) / 4.0 + uv * uv).sqrt());
    let (long, short) = ((half + gap).sqrt(), (half - gap).max(0.0).sqrt());
    let fill = area_mm2 / (4.0 * std::f64::consts::PI * long * short);
    let elongation = long / short;
    let walled = walled_share(slice, centre);
    let is_trachea = elongation <= MAX_ELONGATION
        && fill >= MIN_FILL
        && walled >= MIN_WALLED
        && tissue_mm(slice, centre).into_iter().all(|thickness| thickness >= MIN_TISSUE_MM);
    is_trachea.then(|| Blob {
        depth: slice.depth,
        centre,
        area_mm2,
        elongation,
        walled,
        seed: darkest(slice, pixels, centre),
    })
}

/// The share of directions in which air ends and a wall begins.
fn walled_share(slice: &Slice, centre: [f64; 2]) -> f64 {
    let [du, dv] = slice.pixel_mm;
    let step_mm = du.min(dv) / 2.0;
    let is_walled = |ray: usize| {
        let (sin, cos) = math::sin_cos(std::f64::consts::TAU * ray as f64 / N_RAYS as f64);
        let at = |step: usize| {
            let way = step as f64 * step_mm;
            slice.sample([centre[0] + way * cos / du, centre[1] + way * sin / dv])
        };
        // As far as the border of the slice, which every ray meets.
        let Some(edge) = (0..).find(|&step| at(step).is_none_or(|value| value > AIR_HU)) else {
            return false;
        };
        let n_steps = (WALL_MM / step_mm) as usize + 1;
        (edge..edge + n_steps).any(|step| at(step).is_some_and(|value| value > WALL_HU))
    };
    (0..N_RAYS).filter(|&ray| is_walled(ray)).count() as f64 / N_RAYS as f64
}

impl Slice {
    /// The value of the nearest pixel; none outside the slice.
    fn sample(&self, [u, v]: [f64; 2]) -> Option<f64> {
        let (u, v) = ((u + 0.5).floor(), (v + 0.5).floor());
        let is_inside = u >= 0.0 && v >= 0.0 && u < self.shape[0] as f64 && v < self.shape[1] as f64;
        is_inside.then(|| self.value([u as usize, v as usize]))
    }
}

/// How many mm of tissue lie towards smaller and towards larger v.
fn tissue_mm(slice: &Slice, centre: [f64; 2]) -> [f64; 2] {
    let (u, v) = ((centre[0] + 0.5) as usize, (centre[1] + 0.5) as usize);
    let thickness = |range: std::ops::Range<usize>| {
        range.filter(|&v| slice.value([u, v]) > TISSUE_HU).count() as f64 * slice.pixel_mm[1]
    };
    [thickness(0..v), thickness(v..slice.shape[1])]
}

/// The darkest pixel within half the radius of the centre, of equal ones the first; else the nearest.
fn darkest(slice: &Slice, pixels: &[usize], centre: [f64; 2]) -> [usize; 2] {
    let [du, dv] = slice.pixel_mm;
    let nu = slice.shape[0];
    let reach_mm = (pixels.len() as f64 * du * dv / std::f64::consts::PI).sqrt() / 2.0;
    let offset_mm = |pixel: usize| {
        let (u, v) = (((pixel % nu) as f64 - centre[0]) * du, ((pixel / nu) as f64 - centre[1]) * dv);
        (u * u + v * v).sqrt()
    };
    let value = |pixel: usize| slice.values[pixel];
    let near = pixels.iter().copied().filter(|&pixel| offset_mm(pixel) <= reach_mm);
    let darkest = near.min_by(|&a, &b| value(a).total_cmp(&value(b)).then(a.cmp(&b)));
    let nearest =
        || pixels.iter().copied().min_by(|&a, &b| offset_mm(a).total_cmp(&offset_mm(b)).then(a.cmp(&b)));
    let pixel = darkest.or_else(nearest).unwrap_or_default();
    [pixel % nu, pixel / nu]
}
