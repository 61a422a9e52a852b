//! The colours of a picture as a table, for those who draw the same tree by other means.
//!
//! **Input** a tree with its embedding, what the colours mean. **Output** a few colours, which of them each edge has, and
//! the marks of their scale.
//! **Guarantees** the values and the scale are those of the pictures; colours that blend are cut into [`N_COLORS`].

use espalier_model::{Embedding, Tree};

use crate::Error;
use crate::coloring;
use crate::orientation::Orientation;
use crate::palette::to_byte;
use crate::params::Params;
use crate::scene::Scene;

/// Colours of a continuous scale: neighbours can just be told apart.
const N_COLORS: usize = 20;

/// Colours by edge.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorTable {
    /// What is coloured, with its unit; empty where colours only tell branches apart.
    pub caption: String,
    /// The colours, from the least value to the largest, sRGB.
    pub colors: Vec<[u8; 3]>,
    /// By node: the index of the colour of the edge to its parent.
    pub bins: Vec<u8>,
    /// The marks of the scale: where, from 0 to 1, and what they say.
    pub ticks: Vec<(f64, String)>,
}

/// The colours of a tree as `params.color_by` and `params.theme` say.
///
/// # Errors
/// [`Error`] if a parameter is out of range, or the embedding is another tree's.
pub fn color_table(tree: &Tree, embedding: &Embedding, params: &Params) -> Result<ColorTable, Error> {
    params.validate()?;
    crate::check_entries(tree, embedding)?;
    let orientation = Orientation::of(tree, &Scene::planar(tree, embedding, 1.0)?);
    let coloring = coloring::color((tree, &tree.branches()), embedding, &orientation, params);
    let palette = &coloring.palette;
    let n_colors = if palette.is_continuous { N_COLORS } else { palette.len().min(usize::from(u8::MAX)) };
    let middle = |index: usize| (index as f32 + 0.5) / n_colors as f32;
    // A cast saturates, so that what is not a number has the first colour.
    let bin = |[upper, lower]: &[f32; 2]| {
        ((0.5 * (upper + lower) * n_colors as f32) as usize).min(n_colors - 1) as u8
    };
    let scale = coloring.scale.as_ref();
    Ok(ColorTable {
        caption: scale.map(|scale| scale.caption.clone()).unwrap_or_default(),
        colors: (0..n_colors).map(|index| palette.at(middle(index)).map(to_byte)).collect(),
        bins: coloring.ends.iter().map(bin).collect(),
        ticks: scale.map_or_else(Vec::new, |scale| {
            scale.ticks.iter().map(|tick| (tick.position, tick.text.clone())).collect()
        }),
    })
}
