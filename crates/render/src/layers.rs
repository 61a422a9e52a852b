//! The map as EXR: at each pixel what is seen there, above all the point of the patient.
//!
//! **Input** the raster with the tree and its embedding. **Output** one OpenEXR part, 32-bit float channels, ZIP in
//! blocks of 16 lines. Pixel (x, y) is the pixel (x, y) of the PNG.
//!
//! | channel | what | unit |
//! |---|---|---|
//! | `R G B` | the picture, linear light, premultiplied by `A` | |
//! | `A` | the share of the pixel that the tree covers; 0 is background | |
//! | `radius.mm` | the radius of the organ there, as in the tree | mm |
//! | `height.mm` | the height of the drawn surface over its centreline | mm |
//! | `normal.X Y Z` | the unit normal of the drawn surface: right, up, to the viewer | |
//! | `arc.mm` | the length of the path from the root, in space | mm |
//! | `branch.id` | the branch, as in `nodes.tsv` and the SVG; −1 for background and for a tree of one node | |
//! | `node.id` | the lower node of the edge, as in `nodes.tsv`; −1 for background | |
//! | `position.X Y Z` | the point on the centreline in the patient, RAS+ | mm |
//! | `loss.angle` | angle loss at the upper node of the edge | degrees |
//! | `loss.length` | length loss of the edge, 0.01 = 1 % | |
//!
//! Everywhere that `A` is 0, ids are −1 and all else is 0.
//! **Guarantees** the same bytes for any number of threads: blocks are compressed in parallel and written in order.
//! **Source** OpenEXR 2 scan-line files.

use std::io::Cursor;

use espalier_model::{Branches, Embedding, Tree};
use exr::block::lines::LineRefMut;
use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::image::write::WritableImage;
use exr::image::write::layers::{LayersWriter, WritableLayers};
use exr::image::write::samples::{SamplesWriter, WritableSamples};
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, Image, Layer};
use exr::math::{RoundingMode, Vec2};
use exr::meta::attribute::{LevelMode, LineOrder, SampleType, Text};
use exr::meta::header::{Header, LayerAttributes};
use rayon::prelude::*;

use crate::Error;
use crate::coloring::{angle_loss_deg, length_loss};
use crate::page::Page;
use crate::palette::linear_from_srgb;
use crate::raster::Pixel;

/// Blocks of 16 lines in memory at a time, some 4 MB each on the largest pages.
const BLOCKS_AT_ONCE: usize = 64;

/// What a channel holds at a covered pixel.
type Read = fn(&Layers<'_>, &Pixel) -> f32;

/// The channels, in the alphabetic order in which OpenEXR stores them, with their background.
const CHANNELS: [(&str, f32, Read); 17] = [
    ("A", 0.0, |_, pixel| pixel.coverage),
    ("B", 0.0, |layers, pixel| layers.light(pixel, 2)),
    ("G", 0.0, |layers, pixel| layers.light(pixel, 1)),
    ("R", 0.0, |layers, pixel| layers.light(pixel, 0)),
    ("arc.mm", 0.0, |layers, pixel| layers.along(pixel, |node| layers.arc_mm[node])),
    ("branch.id", -1.0, |layers, pixel| layers.branch(pixel)),
    ("height.mm", 0.0, |layers, pixel| (f64::from(pixel.height_px) / layers.px_per_mm) as f32),
    ("loss.angle", 0.0, |layers, pixel| layers.angle_loss_deg[pixel.node as usize]),
    ("loss.length", 0.0, |layers, pixel| layers.length_loss[pixel.node as usize]),
    ("node.id", -1.0, |_, pixel| pixel.node as f32),
    ("normal.X", 0.0, |_, pixel| pixel.normal[0]),
    ("normal.Y", 0.0, |_, pixel| -pixel.normal[1]),
    ("normal.Z", 0.0, |_, pixel| pixel.normal[2]),
    ("position.X", 0.0, |layers, pixel| layers.along(pixel, |node| layers.tree.position_mm(node).x)),
    ("position.Y", 0.0, |layers, pixel| layers.along(pixel, |node| layers.tree.position_mm(node).y)),
    ("position.Z", 0.0, |layers, pixel| layers.along(pixel, |node| layers.tree.position_mm(node).z)),
    ("radius.mm", 0.0, |layers, pixel| layers.along(pixel, |node| layers.tree.nodes()[node].radius_mm)),
];

/// What the channels read.
#[derive(Debug)]
pub(crate) struct Layers<'a> {
    tree: &'a Tree,
    pixels: &'a [Pixel],
    size: [usize; 2],
    px_per_mm: f64,
    origin_px: glam::DVec2,
    branch_of: Vec<f32>,
    arc_mm: Vec<f64>,
    angle_loss_deg: Vec<f32>,
    length_loss: Vec<f32>,
    light_of_byte: Vec<f32>,
}

impl<'a> Layers<'a> {
    /// Prepares the layers of a raster.
    pub(crate) fn new(
        tree: &'a Tree,
        branches: &Branches,
        embedding: &Embedding,
        (page, pixels): (&Page, &'a [Pixel]),
    ) -> Self {
        let mut arc_mm = vec![0.0; tree.n_nodes()];
        for (node, parent) in tree.edges() {
            arc_mm[node] = arc_mm[parent] + tree.edge_length_mm(node);
        }
        let nodes = 0..tree.n_nodes();
        Self {
            tree,
            pixels,
            size: [page.width as usize, page.height as usize],
            px_per_mm: page.px_per_mm,
            origin_px: page.origin_px,
            branch_of: nodes.clone().map(|n| branches.of_node(n).map_or(-1.0, |b| b as f32)).collect(),
            arc_mm,
            angle_loss_deg: nodes.clone().map(|n| angle_loss_deg(tree, embedding, n) as f32).collect(),
            length_loss: nodes.map(|n| length_loss(tree, embedding, n) as f32).collect(),
            light_of_byte: (0..=255_u8).map(|b| linear_from_srgb(f64::from(b) / 255.0) as f32).collect(),
        }
    }

    /// The file.
    pub(crate) fn encode(&self) -> Result<Vec<u8>, Error> {
        let list = CHANNELS
            .iter()
            .map(|&(name, background, read)| AnyChannel {
                name: Text::from(name),
                sample_data: Samples { layers: self, background, read },
                quantize_linearly: true,
                sampling: Vec2(1, 1),
            })
            .collect();
        let encoding = Encoding {
            compression: exr::compression::Compression::ZIP16,
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        };
        // Only fields with a fixed place: the crate keeps free attributes in a hash map, whose order varies.
        let attributes = LayerAttributes {
            software_name: Text::new_or_none("espalier"),
            comments: Text::new_or_none(self.comment()),
            ..LayerAttributes::default()
        };
        let layer = Layer::new(Vec2(self.size[0], self.size[1]), attributes, encoding, AnyChannels { list });
        let image = Image::from_layer(layer);
        let headers = image.write().infer_meta_data();
        let rows = image.layer_data.create_writer(&headers);
        let mut bytes = Cursor::new(Vec::new());
        exr::block::write(&mut bytes, headers, true, |meta, writer| {
            let blocks: Vec<_> = exr::block::enumerate_ordered_header_block_indices(&meta.headers).collect();
            let compressed = |&(place, index): &(usize, BlockIndex)| {
                let data = rows.extract_uncompressed_block(&meta.headers, index);
                Ok((place, UncompressedBlock { index, data }.compress_to_chunk(&meta.headers)?))
            };
            // In groups, so that few blocks wait uncompressed.
            for group in blocks.chunks(BLOCKS_AT_ONCE) {
                let chunks: Vec<_> = group.par_iter().map(compressed).collect::<exr::error::Result<_>>()?;
                for (place, chunk) in chunks {
                    writer.write_chunk(place, chunk)?;
                }
            }
            Ok(())
        })?;
        Ok(bytes.into_inner())
    }

    /// What a reader needs beside the channel names.
    fn comment(&self) -> String {
        format!(
            "espalier-planar-exr 1; position in RAS+ mm; plane_x_mm = (x + 0.5 - {:.4}) * {:.9e}, \
             plane_y_mm = ({:.4} - y - 0.5) * {:.9e}; A = 0 is background; losses: degrees, share",
            self.origin_px.x,
            1.0 / self.px_per_mm,
            self.origin_px.y,
            1.0 / self.px_per_mm
        )
    }

    fn light(&self, pixel: &Pixel, part: usize) -> f32 {
        self.light_of_byte[usize::from(pixel.color[part])] * pixel.coverage
    }

    fn branch(&self, pixel: &Pixel) -> f32 {
        self.branch_of[pixel.node as usize]
    }

    /// A quantity of nodes at the pixel's place on its edge.
    fn along(&self, pixel: &Pixel, of_node: impl Fn(usize) -> f64) -> f32 {
        let node = pixel.node as usize;
        let parent = self.tree.parent(node).unwrap_or(node);
        let (from, to) = (of_node(parent), of_node(node));
        (from + f64::from(pixel.share) * (to - from)) as f32
    }
}

/// One channel, read pixel by pixel while it is written, so that no copy of the raster is needed.
#[derive(Clone, Copy)]
struct Samples<'a> {
    layers: &'a Layers<'a>,
    background: f32,
    read: Read,
}

impl<'a> WritableSamples<'_> for Samples<'a> {
    type Writer = Samples<'a>;

    fn sample_type(&self) -> SampleType {
        SampleType::F32
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&self, _: &Header) -> Self::Writer {
        *self
    }
}

impl SamplesWriter for Samples<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let Vec2(x, y) = line.location.position;
        let first = y * self.layers.size[0] + x;
        // The line is memory of just this size, so writing to it cannot fail.
        let _ = line.write_samples(|i| {
            let pixel = &self.layers.pixels[first + i];
            if pixel.is_covered() { (self.read)(self.layers, pixel) } else { self.background }
        });
    }
}
