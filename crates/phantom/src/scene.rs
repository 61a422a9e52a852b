//! What surrounds the body in its CT: a thorax, an abdomen, or nothing but water.
//!
//! **Spaces** points are RAS mm, divided by the anatomy's size first.
//! **Source** HU as in a textbook: air −1000, lung −850, fat −100, water 0, blood 45, muscle 50, bone 300 and more.

use espalier_geom::math;
use glam::DVec3;

use crate::lungs::{self, Side, cylinder_depth, ellipsoid_depth};
use crate::texture::Texture;
use crate::vessel::liver_depth;
use crate::{Kind, Params};

const AIR: f64 = -1000.0;
const FAT: f64 = -100.0;
const BLOOD: f64 = 45.0;
const MUSCLE: f64 = 50.0;
const BONE: f64 = 330.0;
/// Distance between neighbouring ribs, and between vertebrae, in mm.
const RIB_PITCH: f64 = 26.0;
/// The size of the texture's cells in mm.
const TEXTURE_MM: f64 = 9.0;

/// The surroundings of a phantom.
pub(crate) struct Scene {
    kind: Kind,
    size: f64,
    texture: Texture,
}

impl Scene {
    pub(crate) fn new(kind: Kind, params: &Params, seed: u64) -> Self {
        Self { kind, size: params.size, texture: Texture::new(TEXTURE_MM, seed) }
    }

    /// The HU at a point outside the phantom's body.
    pub(crate) fn hu(&self, point_mm: DVec3) -> f64 {
        let p = point_mm / self.size;
        match self.kind {
            Kind::Airway => thorax(p, &self.texture),
            Kind::Vessel => abdomen(p, &self.texture),
            _ => 0.0,
        }
    }
}

/// The corners of the scan of an anatomical scene at size 1; `None` where the body alone decides.
pub(crate) fn bounds(kind: Kind) -> Option<(DVec3, DVec3)> {
    match kind {
        Kind::Airway => Some((DVec3::new(-162.0, -112.0, -148.0), DVec3::new(162.0, 108.0, 117.0))),
        Kind::Vessel => Some((DVec3::new(-128.0, -100.0, -84.0), DVec3::new(112.0, 84.0, 70.0))),
        _ => None,
    }
}

/// The HU inside the phantom's body.
pub(crate) fn lumen_hu(kind: Kind) -> f64 {
    match kind {
        Kind::Airway => AIR,
        Kind::Vessel => 210.0,
        _ => 300.0,
    }
}

/// The HU in which to grow from a seed in the lumen.
pub(crate) fn lumen_band(kind: Kind) -> [f64; 2] {
    match kind {
        Kind::Airway => [-1024.0, -900.0],
        Kind::Vessel => [160.0, 400.0],
        _ => [150.0, 600.0],
    }
}

fn thorax(p: DVec3, texture: &Texture) -> f64 {
    // The shoulders narrow towards the neck.
    let narrowing = 1.0 - 0.22 * smooth_step(60.0, 125.0, p.z);
    let rim = math::hypot(p.x / (158.0 * narrowing), (p.y + 2.0) / (106.0 * narrowing));
    if let Some(hu) = trunk_wall(p, rim, 0.30) {
        return hu;
    }
    let oesophagus = ellipsoid_depth(p, DVec3::new(-7.0, -19.0, 48.0), DVec3::new(5.0, 3.5, 15.0));
    if oesophagus > 0.0 {
        return AIR;
    }
    let side = if p.x > 0.0 { Side::Right } else { Side::Left };
    if lungs::depth_mm(side, p) > 0.0 {
        return lung(p, texture);
    }
    if let Some(hu) = spine(p, [0.0, -70.0]) {
        return hu;
    }
    let aorta = cylinder_depth(p, [-22.0, -46.0], [12.0, 12.0]);
    let cava = cylinder_depth(p, [24.0, 18.0], [8.0, 9.0]);
    let is_vessel = (aorta > 0.0 && p.z < 38.0) || (cava > 0.0 && p.z > -20.0);
    if lungs::heart_depth(p) > 3.0 || is_vessel {
        return BLOOD + 5.0 * texture.at(p);
    }
    if lungs::diaphragm_depth(side, p) > 0.0 {
        return below_diaphragm(p, side, texture);
    }
    if rim > 0.8 { MUSCLE } else { -35.0 + 60.0 * texture.at(p) }
}

/// The liver fills the right dome; spleen and stomach lie in the left one, the stomach's gas on top as in a patient
/// who lies on the back.
fn below_diaphragm(p: DVec3, side: Side, texture: &Texture) -> f64 {
    let spleen = ellipsoid_depth(p, DVec3::new(-88.0, -34.0, -128.0), DVec3::new(28.0, 36.0, 34.0));
    let stomach = ellipsoid_depth(p, DVec3::new(-62.0, 26.0, -134.0), DVec3::new(46.0, 42.0, 30.0));
    match side {
        Side::Right => 58.0 + 6.0 * texture.at(p),
        Side::Left if stomach > 3.0 && p.y > 38.0 => AIR,
        Side::Left if stomach > 3.0 => 12.0,
        Side::Left if spleen.max(stomach) > 0.0 => MUSCLE,
        Side::Left => FAT,
    }
}

/// Aerated lung: denser towards the back, where gravity draws the blood, and patchy.
fn lung(p: DVec3, texture: &Texture) -> f64 {
    -852.0 - 0.22 * p.y + 12.0 * texture.at(p) + 8.0 * texture.at(2.7 * p)
}

fn abdomen(p: DVec3, texture: &Texture) -> f64 {
    let rim = math::hypot((p.x + 8.0) / 134.0, (p.y + 12.0) / 98.0);
    if let Some(hu) = trunk_wall(p, rim, 0.42) {
        return hu;
    }
    if liver_depth(p) > 0.0 {
        return 102.0 + 7.0 * texture.at(p);
    }
    if let Some(hu) = spine(p, [-12.0, -74.0]) {
        return hu;
    }
    let aorta = cylinder_depth(p, [-34.0, -52.0], [10.0, 10.0]);
    let right_kidney = ellipsoid_depth(p, DVec3::new(46.0, -58.0, -62.0), DVec3::new(23.0, 17.0, 34.0));
    let left_kidney = ellipsoid_depth(p, DVec3::new(-76.0, -52.0, -40.0), DVec3::new(23.0, 18.0, 36.0));
    let spleen = ellipsoid_depth(p, DVec3::new(-96.0, -36.0, 20.0), DVec3::new(20.0, 34.0, 36.0));
    if aorta > 0.0 || right_kidney.max(left_kidney) > 0.0 {
        return 195.0 + 10.0 * texture.at(p);
    }
    let bowel_gas = ellipsoid_depth(p, DVec3::new(-40.0, 44.0, -54.0), DVec3::new(30.0, 15.0, 14.0));
    if bowel_gas > 0.0 {
        return AIR;
    }
    if spleen > 0.0 { 120.0 + 6.0 * texture.at(p) } else { FAT + 12.0 * texture.at(p) }
}

/// Air around the trunk, skin, fat, ribs, sternum and muscle; `None` inside. `rim` is 1 at the skin.
fn trunk_wall(p: DVec3, rim: f64, rib_slope: f64) -> Option<f64> {
    let is_rib = (0.855..0.905).contains(&rim) && {
        // Ribs fall towards the front and end before the midline, where the sternum stands.
        let phase = (p.z + rib_slope * p.y) / RIB_PITCH;
        phase - phase.floor() < 0.42 && !(p.y > 60.0 && p.x.abs() < 34.0)
    };
    let is_sternum = (0.855..0.915).contains(&rim) && p.y > 60.0 && p.x.abs() < 17.0;
    match rim {
        _ if rim > 1.0 => Some(AIR),
        _ if rim > 0.985 => Some(20.0),
        _ if is_rib || is_sternum => Some(BONE),
        _ if rim > 0.93 => Some(FAT),
        _ if rim > 0.85 => Some(MUSCLE),
        _ => None,
    }
}

/// Vertebrae with discs between them, the canal, the processes behind it.
fn spine(p: DVec3, center: [f64; 2]) -> Option<f64> {
    let body = cylinder_depth(p, center, [19.0, 15.0]);
    let canal = cylinder_depth(p, [center[0], center[1] - 21.0], [9.0, 7.0]);
    let arch = cylinder_depth(p, [center[0], center[1] - 22.0], [14.0, 12.0]);
    let phase = p.z / RIB_PITCH;
    let is_disc = phase - phase.floor() < 0.2;
    match () {
        () if canal > 0.0 => Some(30.0),
        () if body > 2.0 => Some(if is_disc { 90.0 } else { 190.0 }),
        () if body > 0.0 => Some(if is_disc { 90.0 } else { 420.0 }),
        () if arch > 0.0 && !is_disc => Some(BONE),
        () => None,
    }
}

/// 0 below `low`, 1 above `high`, smooth between.
fn smooth_step(low: f64, high: f64, value: f64) -> f64 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
