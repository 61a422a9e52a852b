//! Smooth random texture: values on a lattice, interpolated.

use espalier_geom::random::{Purpose, Stream};
use glam::{DVec3, IVec3};

/// Points of the lattice along each axis; the texture repeats beyond.
const EXTENT: i32 = 32;

/// A smooth random function of space with values in [−1, 1].
pub(crate) struct Texture {
    cell_mm: f64,
    values: Vec<f64>,
}

impl Texture {
    pub(crate) fn new(cell_mm: f64, seed: u64) -> Self {
        let mut stream = Stream::new(seed, Purpose::PhantomNoise, 0, 2);
        let values = (0..EXTENT * EXTENT * EXTENT).map(|_| stream.uniform(-1.0, 1.0)).collect();
        Self { cell_mm, values }
    }

    pub(crate) fn at(&self, point_mm: DVec3) -> f64 {
        let scaled = point_mm / self.cell_mm;
        let corner = scaled.floor();
        let t = scaled - corner;
        // Ease in and out of the lattice points, so that no crease shows there.
        let t = t * t * (3.0 - 2.0 * t);
        let corner = corner.as_ivec3();
        (0..8).fold(0.0, |sum, i| {
            let step = IVec3::new(i & 1, i >> 1 & 1, i >> 2);
            let w = step.as_dvec3() * t + (1 - step).as_dvec3() * (1.0 - t);
            sum + w.x * w.y * w.z * self.value(corner + step)
        })
    }

    fn value(&self, point: IVec3) -> f64 {
        let [x, y, z] = point.to_array().map(|c| c.rem_euclid(EXTENT));
        self.values[((z * EXTENT + y) * EXTENT + x) as usize]
    }
}
