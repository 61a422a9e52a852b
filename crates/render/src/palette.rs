//! Colours: anchors from ColorBrewer, interpolated in CIE Lab into tables.
//!
//! **Input** a few anchor colours. **Output** a table of sRGB colours at even steps.
//! **Steps** 1. anchors from sRGB to Lab. 2. Linear interpolation there, so that equal steps look equal.
//! 3. Back to sRGB, clipped.
//! **Guarantees** the anchors themselves are met exactly; the table is the same on every machine.
//! **Source** [ColorBrewer] classes RdYlBu-3, YlGnBu and YlOrRd; [OkabeIto] for unordered branches;
//! CIE 1976 L*a*b* with the D65 white of sRGB.

use espalier_geom::math;

use crate::params::Theme;

/// An sRGB colour, each part in [0, 1].
pub(crate) type Rgb = [f32; 3];

/// Entries of a continuous table: finer than 8 bits can tell apart.
const N_STEPS: usize = 513;

/// RdYlBu with 3 classes, reversed: thin is blue, the mean yellow, thick red. Colour-blind and print safe.
const DIVERGING: [u32; 3] = [0x91_bfdb, 0xff_ffbf, 0xfc_8d59];

/// YlGnBu with 5 classes, without its lightest end, which white paper would swallow: for ordered counts.
const ORDERED: [u32; 5] = [0xc7_e9b4, 0x7f_cdbb, 0x41_b6c4, 0x2c_7fb8, 0x25_3494];

/// YlOrRd after a cool grey that says "nothing lost": for losses.
const LOSSES: [u32; 5] = [0xc6_d0d8, 0xfe_d976, 0xfd_8d3c, 0xe3_1a1c, 0x80_0026];

/// The same for a dark page: the worst must be the brightest.
const LOSSES_ON_DARK: [u32; 5] = [0x5a_646e, 0xb1_0026, 0xe3_1a1c, 0xfd_8d3c, 0xff_eda0];

/// The colours of Okabe and Ito without black and yellow, lightened a little by the shading: for names.
const NAMES: [u32; 6] = [0xe6_9f00, 0x56_b4e9, 0x00_9e73, 0x00_72b2, 0xd5_5e00, 0xcc_79a7];

/// What became narrower or shorter is blue, what became wider or longer orange, no change a light grey. Safe for the
/// colour-blind; ours.
const CHANGES: [u32; 5] = [0x1b_5fa8, 0x7f_afd8, 0xcc_ccc8, 0xf2_a65a, 0xc2_4a05];

/// Lost, new, and neither: unlike each other and both ends of [`CHANGES`] in hue and lightness, on light and dark pages.
const FATES: [u32; 3] = [0xb8_0f78, 0x12_9b56, 0xa4_a8ad];

/// A table of colours, read by a value in [0, 1].
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Palette {
    table: Vec<Rgb>,
    /// Whether neighbours blend into each other.
    pub is_continuous: bool,
}

impl Palette {
    /// Blue, yellow, red.
    pub(crate) fn diverging() -> Self {
        Self::continuous(&DIVERGING)
    }

    /// Light green to dark blue; the other way round on a dark page, where the fine far branches must be light.
    pub(crate) fn ordered(theme: Theme) -> Self {
        let mut anchors = ORDERED;
        if theme == Theme::Dark {
            anchors.reverse();
        }
        Self::continuous(&anchors)
    }

    /// Grey, then ever further from the colour of the page.
    pub(crate) fn losses(theme: Theme) -> Self {
        Self::continuous(if theme == Theme::Dark { &LOSSES_ON_DARK } else { &LOSSES })
    }

    /// Black to white, in even steps of lightness.
    pub(crate) fn greys() -> Self {
        Self::continuous(&[0x00_0000, 0xff_ffff])
    }

    /// Less, no change, more.
    pub(crate) fn changes() -> Self {
        Self::continuous(&CHANGES)
    }

    /// The colours of what is lost, new, and neither.
    pub(crate) fn fates() -> [Rgb; 3] {
        FATES.map(rgb)
    }

    /// The same table with further colours behind it; also what to multiply values by, and the value of each of them.
    pub(crate) fn with(&self, further: [Rgb; 3]) -> (Self, f32, [f32; 3]) {
        // Each stands three times, so that no rounding reads its neighbour.
        let table: Vec<Rgb> =
            self.table.iter().copied().chain(further.into_iter().flat_map(|color| [color; 3])).collect();
        let last = (table.len() - 1) as f32;
        let n_own = self.len();
        let value = |i: usize| (n_own + 3 * i + 1) as f32 / last;
        (Self { table, is_continuous: true }, (n_own - 1) as f32 / last, [value(0), value(1), value(2)])
    }

    /// Unordered colours for names.
    pub(crate) fn names() -> Self {
        Self { table: NAMES.map(rgb).to_vec(), is_continuous: false }
    }

    /// The first `n` colours, at least one; from the first again where there are fewer.
    pub(crate) fn first(&self, n: usize) -> Self {
        Self { table: self.table.iter().copied().cycle().take(n.max(1)).collect(), is_continuous: false }
    }

    /// Grey for what all parts have in common, then unordered colours for the parts.
    pub(crate) fn parts(theme: Theme) -> Self {
        let grey = if theme == Theme::Dark { 0xb4_b8c0 } else { 0x8a_8f98 };
        let table = std::iter::once(grey).chain(NAMES).map(rgb).collect();
        Self { table, is_continuous: false }
    }

    /// Grey, then the colours of labels; those that have none take colours for names in turn.
    pub(crate) fn labels(colors: impl Iterator<Item = Option<[u8; 3]>>, theme: Theme) -> Self {
        let parts = Self::parts(theme);
        let own = |(i, color): (usize, Option<[u8; 3]>)| {
            color.map_or(rgb(NAMES[i % NAMES.len()]), |color| color.map(|part| f32::from(part) / 255.0))
        };
        let table = parts.table.into_iter().take(1).chain(colors.enumerate().map(own)).collect();
        Self { table, is_continuous: false }
    }

    /// The last `n` colours.
    pub(crate) fn last(&self, n: usize) -> Self {
        let table = self.table[self.len().saturating_sub(n.max(1))..].to_vec();
        Self { table, is_continuous: false }
    }

    /// The same colours in `n` flat steps.
    pub(crate) fn in_steps(&self, n: usize) -> Self {
        let position = |i: usize| if n > 1 { i as f32 / (n - 1) as f32 } else { 0.5 };
        Self { table: (0..n.max(1)).map(|i| self.at(position(i))).collect(), is_continuous: false }
    }

    fn continuous(anchors: &[u32]) -> Self {
        let lab: Vec<[f64; 3]> = anchors.iter().map(|&anchor| lab_from_rgb(rgb(anchor))).collect();
        let n_spans = lab.len() - 1;
        let table = (0..N_STEPS)
            .map(|i| {
                let place = (i * n_spans) as f64 / (N_STEPS - 1) as f64;
                let span = (place as usize).min(n_spans - 1);
                let share = place - span as f64;
                rgb_from_lab(std::array::from_fn(|k| {
                    lab[span][k] + share * (lab[span + 1][k] - lab[span][k])
                }))
            })
            .collect();
        Self { table, is_continuous: true }
    }

    /// The colour at a value alone.
    pub(crate) fn only(&self, value: f32) -> Self {
        Self { table: vec![self.at(value)], is_continuous: false }
    }

    /// How many colours it has.
    pub(crate) fn len(&self) -> usize {
        self.table.len()
    }

    /// The value that reads the colour of index `i`.
    pub(crate) fn value_of(&self, i: usize) -> f32 {
        ((i % self.len()) as f32 + 0.5) / self.len() as f32
    }

    /// The colour at a value in [0, 1]; values outside are clipped.
    pub(crate) fn at(&self, value: f32) -> Rgb {
        let last = self.len() - 1;
        let place = if self.is_continuous { value * last as f32 + 0.5 } else { value * self.len() as f32 };
        // A cast from float saturates, so negative values and NaN read the first entry.
        self.table[(place as usize).min(last)]
    }
}

/// The colours of a page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PageColors {
    /// Paper.
    pub background: Rgb,
    /// Text and marks.
    pub ink: Rgb,
    /// Text of second rank.
    pub soft: Rgb,
    /// The outline of the branches, towards which their colour fades at the rim.
    pub rim: Rgb,
    /// What must not be overlooked, such as a crossing.
    pub alarm: Rgb,
    /// How dark the outline of branches is, 0 to 1.
    pub outline: f32,
}

impl PageColors {
    /// The colours of a theme.
    pub(crate) fn of(theme: Theme) -> Self {
        match theme {
            Theme::Light => Self {
                background: rgb(0xff_ffff),
                ink: rgb(0x1a_1c20),
                soft: rgb(0x5a_5f68),
                rim: rgb(0x2b_2a33),
                alarm: rgb(0xd0_021b),
                outline: 0.5,
            },
            Theme::Print => Self {
                background: rgb(0xff_ffff),
                ink: rgb(0x00_0000),
                soft: rgb(0x3c_3c3c),
                rim: rgb(0x12_1212),
                alarm: rgb(0xc0_0000),
                outline: 0.85,
            },
            Theme::Dark => Self {
                background: rgb(0x11_1317),
                ink: rgb(0xf2_f3f5),
                soft: rgb(0xa7_acb5),
                rim: rgb(0x08_090b),
                alarm: rgb(0xff_4d4d),
                outline: 0.5,
            },
        }
    }
}

/// The parts of `0xRRGGBB`.
fn rgb(hex: u32) -> Rgb {
    [16, 8, 0].map(|shift| ((hex >> shift) & 0xff) as f32 / 255.0)
}

/// `#rrggbb`.
pub(crate) fn hex(color: Rgb) -> String {
    let [r, g, b] = color.map(to_byte);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// A part of a colour as a byte, rounded.
pub(crate) fn to_byte(part: f32) -> u8 {
    (part * 255.0 + 0.5) as u8
}

/// Light of an sRGB part: the inverse of the sRGB transfer curve.
pub(crate) fn linear_from_srgb(part: f64) -> f64 {
    if part <= 0.040_45 { part / 12.92 } else { math::pow((part + 0.055) / 1.055, 2.4) }
}

fn srgb_from_linear(light: f64) -> f64 {
    let light = light.clamp(0.0, 1.0);
    if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * math::pow(light, 1.0 / 2.4) - 0.055 }
}

/// XYZ of the D65 white of sRGB.
const WHITE: [f64; 3] = [0.950_47, 1.0, 1.088_83];
/// Where the cube root of Lab turns into a straight line: (6/29)³.
const LAB_KNEE: f64 = 216.0 / 24_389.0;
/// The slope of that line: (29/3)³ / 116.
const LAB_SLOPE: f64 = 24_389.0 / 27.0;

fn lab_from_rgb(color: Rgb) -> [f64; 3] {
    let [r, g, b] = color.map(|part| linear_from_srgb(f64::from(part)));
    let xyz = [
        0.412_456_4 * r + 0.357_576_1 * g + 0.180_437_5 * b,
        0.212_672_9 * r + 0.715_152_2 * g + 0.072_175_0 * b,
        0.019_333_9 * r + 0.119_192_0 * g + 0.950_304_1 * b,
    ];
    let [fx, fy, fz] = std::array::from_fn(|k| {
        let share = xyz[k] / WHITE[k];
        if share > LAB_KNEE { math::cbrt(share) } else { (LAB_SLOPE * share + 16.0) / 116.0 }
    });
    [116.0 * fy - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz)]
}

fn rgb_from_lab([lightness, a, b]: [f64; 3]) -> Rgb {
    let fy = (lightness + 16.0) / 116.0;
    let f = [fy + a / 500.0, fy, fy - b / 200.0];
    let [x, y, z] = std::array::from_fn(|k| {
        let cube = f[k] * f[k] * f[k];
        WHITE[k] * if cube > LAB_KNEE { cube } else { (116.0 * f[k] - 16.0) / LAB_SLOPE }
    });
    [
        3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
        -0.969_266_0 * x + 1.876_010_8 * y + 0.041_556_0 * z,
        0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
    ]
    .map(|light| srgb_from_linear(light) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_are_met() {
        let palette = Palette::diverging();
        for (value, anchor) in [(0.0, "#91bfdb"), (0.5, "#ffffbf"), (1.0, "#fc8d59"), (-3.0, "#91bfdb")] {
            assert_eq!(hex(palette.at(value)), anchor);
        }
        assert_eq!(hex(palette.at(f32::NAN)), "#91bfdb");
    }

    #[test]
    fn steps_and_names() {
        let steps = Palette::ordered(Theme::Light).in_steps(3);
        assert_eq!(steps.len(), 3);
        assert_eq!(hex(steps.at(steps.value_of(0))), "#c7e9b4");
        assert_eq!(hex(steps.at(steps.value_of(2))), "#253494");
        let names = Palette::names();
        assert_eq!(names.at(names.value_of(7)), names.at(names.value_of(1)));
        assert_ne!(names.at(names.value_of(0)), names.at(names.value_of(1)));
    }

    #[test]
    fn lab_goes_there_and_back() {
        for color in [[0.0; 3], [1.0; 3], [0.1, 0.6, 0.9], [0.02, 0.01, 0.0]] {
            let back = rgb_from_lab(lab_from_rgb(color));
            assert!(color.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-4), "{color:?} {back:?}");
        }
    }
}
