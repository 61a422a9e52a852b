//! Light on the surface.
//!
//! **Input** a normal, a base colour, the distance to the outline. **Output** an sRGB colour.
//! **Steps** 1. Lambert from the upper left, wrapped a little so that the far side keeps its hue. 2. A soft
//! highlight. 3. A soft rim: the colour fades to dark where the surface turns away. 4. A thin outline on branches
//! wide enough for one, so that pale yellow still reads on white paper.
//! **Source** section 4.1 of [Hu2022] (pseudo-surface); the constants are empirical, chosen by looking.

use glam::Vec3;

use crate::palette::{PageColors, Rgb};
use crate::params::Style;

/// Towards the light: left, up, to the viewer (y points down). Unit length to six digits.
const TO_LIGHT: Vec3 = Vec3::new(-0.35, -0.42, 0.837_317);
/// Half way between light and viewer.
const HALFWAY: Vec3 = Vec3::new(-0.182_584, -0.219_101, 0.958_466);
/// How far the light reaches past the terminator.
const WRAP: f32 = 0.35;
const AMBIENT: f32 = 0.50;
const DIFFUSE: f32 = 0.56;
const HIGHLIGHT: f32 = 0.13;
/// How much of the rim's dark the surface takes where it is seen edge on.
const RIM: f32 = 0.55;
/// Width of the outline in pixels, and its largest share of the radius.
const OUTLINE_PX: f32 = 1.1;
const OUTLINE_SHARE: f32 = 0.3;
/// How dark the seam is where distant parts touch.
pub(crate) const SEAM: f32 = 0.55;

/// A lit place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Unit normal, y down, z to the viewer.
    pub normal: Vec3,
    /// Distance to the outline of everything drawn, negative inside, in pixels.
    pub outside_px: f32,
    /// The radius there, in pixels.
    pub radius_px: f32,
}

/// The colour of a place.
pub(crate) fn shade(base: Rgb, place: &Place, colors: &PageColors, style: Style) -> Rgb {
    let rim = colors.rim;
    let outline_px = OUTLINE_PX.min(OUTLINE_SHARE * place.radius_px).max(1e-3);
    let outline = colors.outline * (1.0 + place.outside_px / outline_px).clamp(0.0, 1.0);
    match style {
        // Lines are flat; a little of the rim keeps the palest colours off the paper.
        Style::Line => return mix(base, rim, 0.24 * colors.outline),
        Style::Ribbon => return mix(base, rim, outline),
        Style::PseudoSurface | Style::Volume => {}
    }
    let n = place.normal;
    let lambert = ((n.dot(TO_LIGHT) + WRAP) / (1.0 + WRAP)).max(0.0);
    let light = AMBIENT + DIFFUSE * lambert;
    let gloss = n.dot(HALFWAY).max(0.0);
    let gloss = {
        let g2 = gloss * gloss;
        let g4 = g2 * g2;
        let g8 = g4 * g4;
        g8 * g8 * g8
    };
    let lit = base.map(|part| (part * light + HIGHLIGHT * gloss * (1.0 - 0.5 * part)).clamp(0.0, 1.0));

    let turned = 1.0 - n.z.clamp(0.0, 1.0);
    mix(lit, rim, (RIM * turned * turned).max(outline))
}

/// `a` with a share of `b`.
pub(crate) fn mix(a: Rgb, b: Rgb, share: f32) -> Rgb {
    std::array::from_fn(|k| a[k] + share * (b[k] - a[k]))
}
