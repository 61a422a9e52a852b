//! The map as EXR: at each pixel what is seen there, above all the point of the patient.
//!
//! **Input** the raster, band by band, with the tree and its embedding. **Output** one OpenEXR part, ZIP in blocks of 16
//! lines. Pixel (x, y) is the pixel (x, y) of the PNG.
//!
//! | channel | what | unit |
//! |---|---|---|
//! | `R G B` | the picture, linear light, premultiplied by `A`; 16 bits | |
//! | `A` | the share of the pixel that the tree covers; 0 is background; 16 bits | |
//! | `across.mm` | how far to the left of the centreline, seen from the root | mm |
//! | `radius.mm` | the radius of the organ there, as in the tree | mm |
//! | `height.mm` | the height of the drawn surface over its centreline | mm |
//! | `normal.X Y Z` | the unit normal of the drawn surface: right, up, to the viewer; 16 bits | |
//! | `arc.mm` | the length of the path from the root, in space | mm |
//! | `branch.id` | the branch, as in `nodes.tsv` and the SVG; −1 for background and for a tree of one node | |
//! | `node.id` | the lower node of the edge, as in `nodes.tsv`; −1 for background | |
//! | `position.X Y Z` | the point of the patient that the middle of the pixel stands for, RAS+: see [`PlanarMap`] | mm |
//! | `loss.angle` | angle loss at the upper node of the edge | degrees |
//! | `loss.length` | length loss of the edge, 0.01 = 1 % | |
//! | `loss.orientation` | by how much the edge runs otherwise in space than the map's letters say | degrees |
//!
//! | `volume.value` | the scan there, for a picture that shows one; NaN where it has no value | its own |
//!
//! Everywhere that `A` is 0, ids are −1, `volume.value` is NaN and all else is 0. Channels have 32 bits where nothing else is said. Lengths are
//! rounded to 1/256 of a pixel, so that the rest of their digits need no room.
//! **Guarantees** the same bytes for any number of threads: blocks are compressed in parallel and written in order.
//! **Source** OpenEXR 2 scan-line files. The blocks are packed here: the crate's own packing takes three times as long.

mod pack;

use std::io::Cursor;

use espalier_geom::math;
use espalier_model::{Branches, Embedding, Tree};
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::compression::Compression;
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, LineOrder, SampleType, Text};
use exr::meta::header::{Header, LayerAttributes};
use glam::DVec2;
use pack::Halves;

use crate::Error;
use crate::coloring::{angle_loss_deg, length_loss};
use crate::map::PlanarMap;
use crate::orientation::Orientation;
use crate::page::{Page, Paper};
use crate::palette::linear_from_srgb;
use crate::raster::Pixel;

/// Lines of a block, as OpenEXR fixes them for this compression.
const BLOCK: usize = 16;
/// Steps of a length, of a pixel.
const STEPS_PER_PX: f64 = 256.0;

/// A covered pixel with what is known of it beside.
struct Seen<'a> {
    pixel: &'a Pixel,
    /// Its point in the patient, mm.
    position_mm: [f32; 3],
    /// The scan there; NaN where it has no value.
    value: f32,
}

/// What a channel holds at a covered pixel.
type Read = fn(&Layers<'_>, &Seen<'_>) -> f32;

const F16: SampleType = SampleType::F16;
const F32: SampleType = SampleType::F32;

/// The channels, in the alphabetic order in which OpenEXR stores them, with their background.
const CHANNELS: [(&str, SampleType, f32, Read); 20] = [
    ("A", F16, 0.0, |_, seen| seen.pixel.coverage),
    ("B", F16, 0.0, |layers, seen| layers.light(seen.pixel, 2)),
    ("G", F16, 0.0, |layers, seen| layers.light(seen.pixel, 1)),
    ("R", F16, 0.0, |layers, seen| layers.light(seen.pixel, 0)),
    ("across.mm", F32, 0.0, |layers, seen| layers.drawn_mm(seen.pixel.across_px)),
    ("arc.mm", F32, 0.0, |layers, seen| layers.along(seen.pixel, |node| layers.arc_mm[node])),
    ("branch.id", F32, -1.0, |layers, seen| layers.branch(seen.pixel)),
    ("height.mm", F32, 0.0, |layers, seen| layers.drawn_mm(seen.pixel.height_px)),
    ("loss.angle", F32, 0.0, |layers, seen| layers.angle_loss_deg[seen.pixel.node as usize]),
    ("loss.length", F32, 0.0, |layers, seen| layers.length_loss[seen.pixel.node as usize]),
    ("loss.orientation", F32, 0.0, |layers, seen| layers.orientation_loss_deg[seen.pixel.node as usize]),
    ("node.id", F32, -1.0, |_, seen| seen.pixel.node as f32),
    ("normal.X", F16, 0.0, |_, seen| seen.pixel.normal[0]),
    ("normal.Y", F16, 0.0, |_, seen| -seen.pixel.normal[1]),
    ("normal.Z", F16, 0.0, |_, seen| seen.pixel.normal[2]),
    ("position.X", F32, 0.0, |_, seen| seen.position_mm[0]),
    ("position.Y", F32, 0.0, |_, seen| seen.position_mm[1]),
    ("position.Z", F32, 0.0, |_, seen| seen.position_mm[2]),
    ("radius.mm", F32, 0.0, |layers, seen| layers.along(seen.pixel, |n| layers.tree.nodes()[n].radius_mm)),
    // The last, and only where there is a scan. No number of it can be taken for background.
    ("volume.value", F32, f32::NAN, |_, seen| seen.value),
];

/// What the channels read.
#[derive(Debug)]
pub(crate) struct Layers<'a> {
    tree: &'a Tree,
    map: &'a PlanarMap<'a>,
    sheet: Paper<'a>,
    turn_deg: u32,
    /// Whether there is a scan to show.
    has_values: bool,
    /// Steps of a length, per mm.
    steps_per_mm: f64,
    mm_per_step: f64,
    branch_of: Vec<f32>,
    arc_mm: Vec<f64>,
    angle_loss_deg: Vec<f32>,
    length_loss: Vec<f32>,
    orientation_loss_deg: Vec<f32>,
    light_of_byte: Vec<f32>,
    /// A whole block of background, packed: most of a picture is paper.
    paper: Vec<u8>,
}

impl<'a> Layers<'a> {
    /// Prepares the layers of a page.
    pub(crate) fn new(
        (tree, branches): (&'a Tree, &Branches),
        (map, embedding): (&'a PlanarMap<'a>, &Embedding),
        orientation: &Orientation,
        (page, turn_deg, has_values): (&'a Page, u32, bool),
    ) -> Self {
        let mut arc_mm = vec![0.0; tree.n_nodes()];
        for (node, parent) in tree.edges() {
            arc_mm[node] = arc_mm[parent] + tree.edge_length_mm(node);
        }
        let nodes = 0..tree.n_nodes();
        // A power of two, so that rounded numbers end in zero bits.
        let steps = math::log2((STEPS_PER_PX * page.px_per_mm).clamp(f64::MIN_POSITIVE, 1e100));
        let mut layers = Self {
            tree,
            map,
            sheet: Paper::new(page, turn_deg),
            turn_deg,
            has_values,
            steps_per_mm: math::pow(2.0, math::ceil(steps)),
            mm_per_step: math::pow(2.0, -math::ceil(steps)),
            branch_of: nodes.clone().map(|n| branches.of_node(n).map_or(-1.0, |b| b as f32)).collect(),
            arc_mm,
            angle_loss_deg: nodes.clone().map(|n| angle_loss_deg(tree, embedding, n) as f32).collect(),
            length_loss: nodes.map(|n| length_loss(tree, embedding, n) as f32).collect(),
            orientation_loss_deg: orientation.loss_deg.iter().map(|&loss| loss as f32).collect(),
            light_of_byte: (0..=255_u8).map(|b| linear_from_srgb(f64::from(b) / 255.0) as f32).collect(),
            paper: Vec::new(),
        };
        layers.paper = layers.pack(0, &vec![Pixel::EMPTY; BLOCK * page.width as usize], &[]);
        layers
    }

    /// The packed blocks of a band of rows, whose first is a multiple of a block's; with the scan at each pixel, if
    /// there is one.
    pub(crate) fn blocks(&self, first_row: usize, pixels: &[Pixel], values: &[f32]) -> Vec<Vec<u8>> {
        let n_whole = BLOCK * self.sheet.page.width as usize;
        let packed = |(i, block): (usize, &[Pixel])| {
            let is_paper = block.len() == n_whole && !block.iter().any(Pixel::is_covered);
            let values = values.get(i * n_whole..).unwrap_or_default();
            if is_paper { self.paper.clone() } else { self.pack(first_row + i * BLOCK, block, values) }
        };
        pixels.chunks(n_whole).enumerate().map(packed).collect()
    }

    /// The channels of this picture.
    fn channels(&self) -> &'static [(&'static str, SampleType, f32, Read)] {
        if self.has_values { &CHANNELS } else { &CHANNELS[..CHANNELS.len() - 1] }
    }

    /// What is known of a pixel; nothing of background.
    fn seen<'p>(&self, pixel: &'p Pixel, [column, row]: [usize; 2], value: f32) -> Option<Seen<'p>> {
        if !pixel.is_covered() {
            return None;
        }
        let at = self.sheet.plane_mm(DVec2::new(column as f64, row as f64) + 0.5);
        let position = self.map.from_plane(pixel.node as usize, at).patient_mm;
        Some(Seen { pixel, position_mm: position.to_array().map(|part| self.rounded(part)), value })
    }

    /// A block as OpenEXR stores it: line by line, in a line channel by channel; then the bytes of even places before
    /// those of odd ones, as differences, deflated. What does not get smaller is stored as it is.
    fn pack(&self, first_row: usize, block: &[Pixel], values: &[f32]) -> Vec<u8> {
        let bytes_per_pixel: usize = self.channels().iter().map(|channel| channel.1.bytes_per_sample()).sum();
        let mut halves = Halves::with_room(bytes_per_pixel * block.len());
        let width = self.sheet.page.size()[0];
        for (row, line) in block.chunks(width).enumerate() {
            let value = |column: usize| values.get(row * width + column).copied().unwrap_or(f32::NAN);
            let seen = |(x, pixel)| Some((x, self.seen(pixel, [x, first_row + row], value(x))?));
            let covered: Vec<(usize, Seen<'_>)> = line.iter().enumerate().filter_map(seen).collect();
            for &(_, sample_type, background, read) in self.channels() {
                let mut values = vec![background; line.len()];
                for (x, seen) in &covered {
                    values[*x] = read(self, seen);
                }
                halves.take(&values, sample_type);
            }
        }
        halves.packed()
    }

    /// The file of all blocks, from the top.
    pub(crate) fn file(&self, blocks: Vec<Vec<u8>>) -> Result<Vec<u8>, Error> {
        let channels = self.channels().iter().map(|&(name, sample_type, ..)| ChannelDescription {
            name: Text::from(name),
            sample_type,
            quantize_linearly: true,
            sampling: Vec2(1, 1),
        });
        // Only fields with a fixed place: the crate keeps free attributes in a hash map, whose order varies.
        let attributes = LayerAttributes {
            software_name: Text::new_or_none("espalier"),
            comments: Text::new_or_none(self.comment()),
            ..LayerAttributes::default()
        };
        let [width, height] = self.sheet.page.size();
        let size = Vec2(width, height);
        let header = Header::new(Text::from(""), size, channels.collect())
            .with_encoding(Compression::ZIP16, BlockDescription::ScanLines, LineOrder::Increasing)
            .with_attributes(attributes);
        let n_bytes = blocks.iter().map(Vec::len).sum::<usize>();
        let mut bytes = Cursor::new(Vec::with_capacity(n_bytes + 32 * blocks.len() + 4096));
        exr::block::write(&mut bytes, std::iter::once(header).collect(), true, |_, writer| {
            for (index, compressed_pixels_le) in blocks.into_iter().enumerate() {
                let y_coordinate = (index * BLOCK) as i32;
                let block = CompressedScanLineBlock { y_coordinate, compressed_pixels_le };
                let compressed_block = CompressedBlock::ScanLine(block);
                writer.write_chunk(index, Chunk { layer_index: 0, compressed_block })?;
            }
            Ok(())
        })?;
        Ok(bytes.into_inner())
    }

    /// What a reader needs beside the channel names.
    fn comment(&self) -> String {
        let Page { px_per_mm, origin_px, .. } = self.sheet.page;
        format!(
            "espalier-planar-exr 3; position in RAS+ mm; plane_x_mm = (x + 0.5 - {:.4}) * {:.9e}, \
             plane_y_mm = ({:.4} - y - 0.5) * {:.9e}; turned by {} degrees counter-clockwise; A = 0 is background; \
             losses: degrees, share",
            origin_px.x,
            1.0 / px_per_mm,
            origin_px.y,
            1.0 / px_per_mm,
            self.turn_deg
        )
    }

    fn light(&self, pixel: &Pixel, part: usize) -> f32 {
        self.light_of_byte[usize::from(pixel.color[part])] * pixel.coverage
    }

    fn branch(&self, pixel: &Pixel) -> f32 {
        self.branch_of[pixel.node as usize]
    }

    /// A length in the picture.
    fn drawn_mm(&self, length_px: f32) -> f32 {
        self.rounded(f64::from(length_px) / self.sheet.page.px_per_mm)
    }

    /// A quantity of nodes at the pixel's place on its edge, mm.
    fn along(&self, pixel: &Pixel, of_node: impl Fn(usize) -> f64) -> f32 {
        let node = pixel.node as usize;
        let parent = self.tree.parent(node).unwrap_or(node);
        let (from, to) = (of_node(parent), of_node(node));
        self.rounded(from + f64::from(pixel.share) * (to - from))
    }

    fn rounded(&self, length_mm: f64) -> f32 {
        let steps = length_mm * self.steps_per_mm;
        // Beyond this no digits are left to round.
        if steps.abs() < 1e15 { (floor(steps + 0.5) * self.mm_per_step) as f32 } else { length_mm as f32 }
    }
}

/// The whole number at or below a number under 2⁶³; the library's own takes ten times as long where it is called for
/// every pixel.
fn floor(number: f64) -> f64 {
    let towards_zero = number as i64 as f64;
    if towards_zero > number { towards_zero - 1.0 } else { towards_zero }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floor_is_the_whole_number_below() {
        for (number, below) in
            [(2.5, 2.0), (-2.5, -3.0), (-3.0, -3.0), (0.0, 0.0), (1e15, 1e15), (-0.2, -1.0)]
        {
            assert_eq!(floor(number), below);
            assert_eq!(floor(number), math::floor(number));
        }
    }
}
