//! From the scan to the map and back, of a run that is done.
//!
//! **Input** a run folder; points in the patient (RAS+ mm, LPS+ mm or voxels of the mask) or on the map (plane mm, or
//! pixels of `planar.png`). **Output** for each point both places, the branch, and how far it lies off the centreline.
//! **Steps** 1. read the run's tree, layout and views, and where they are the mask, the branches' labels and the
//! picture's scale; 2. bring each point into RAS+ mm or the plane; 3. ask the map ([`PlanarMap`]) to which edge it
//! belongs, and what it is on the other side.
//! **Guarantees** nothing is written; files that are not what the run wrote are refused; one definition of the map with
//! the EXR and the volume on the map. A node of the tree is found where the layout has it, and back.
//! **Cost** O(edges) a point.

mod answer;
mod points;

use std::path::Path;

use espalier_geom::math;
use espalier_model::{Embedding, Grid, Mask, Tree, ViewHierarchy, swc};
use espalier_render::PlanarMap;
use glam::{DVec2, DVec3};

pub use answer::{InMask, LOCATE_COLUMNS, Located, LocatedPoint};
pub use points::{Given, PointError, Space, read_point, read_points};

use crate::error::Error;
use crate::folder::RunFolder;
use crate::run::boxed;
use crate::stage::{Artifact, Stage};

const BRANCHES: &str = "branches.tsv";
const PICTURE: &str = "planar.exr";
/// The comment stands in the header, of less than a kilobyte.
const HEADER_BYTES: usize = 1 << 14;

/// Finds points of a run on both sides.
///
/// # Errors
/// A folder without tree, layout or views; files that were altered; voxels of a run that has no mask, pixels of one that
/// has no picture.
pub fn locate(folder: &Path, points: &[Given], max_memory_bytes: u64) -> Result<Located, Error> {
    let opened = Opened::read(folder, max_memory_bytes)?;
    let map = PlanarMap::of(&opened.tree, &opened.embedding, &opened.views);
    let points = points.iter().map(|given| opened.point(&map, given)).collect::<Result<_, _>>()?;
    Ok(Located { points, decimals: opened.embedding.decimals() })
}

/// What is known of a run.
struct Opened {
    tree: Tree,
    embedding: Embedding,
    views: ViewHierarchy,
    mask: Option<Mask>,
    labels: Vec<Option<(String, String)>>,
    picture: Option<Picture>,
    arc_mm: Vec<f64>,
}

/// Where the plane lies in `planar.png`.
struct Picture {
    mm_per_px: f64,
    origin_px: DVec2,
    /// The unit vector in the picture along which the plane's x axis lies, y up.
    x_axis: DVec2,
}

impl Opened {
    fn read(folder: &Path, max_bytes: u64) -> Result<Self, Error> {
        let run = RunFolder::to_read(folder);
        let text = |file: &str| -> Result<String, Error> {
            Ok(String::from_utf8_lossy(&run.read(file)?).into_owned())
        };
        let named = |file: &'static str| folder.join(file);
        let tree_file = Artifact::Tree.file();
        let tree = swc::read_tree(&text(tree_file)?).map_err(|e| Error::file(&named(tree_file), e))?;
        let file = Artifact::Embedding.file();
        let embedding =
            Embedding::from_json(&text(file)?, &tree).map_err(|e| Error::file(&named(file), e))?;
        let file = Artifact::Views.file();
        let views =
            ViewHierarchy::from_json(&text(file)?, &tree).map_err(|e| Error::file(&named(file), e))?;
        let has = |file: &str| folder.join(file).is_file();
        let labels = if has(BRANCHES) { answer::labels(&text(BRANCHES)?) } else { Vec::new() };
        let picture = if has(PICTURE) { Picture::of(&run.read(PICTURE)?) } else { None };
        let mask = read_mask(&run, max_bytes)?;
        let mut arc_mm = vec![0.0; tree.n_nodes()];
        for (node, parent) in tree.edges() {
            arc_mm[node] = arc_mm[parent] + tree.edge_length_mm(node);
        }
        Ok(Self { tree, embedding, views, mask, labels, picture, arc_mm })
    }

    fn point(&self, map: &PlanarMap<'_>, given: &Given) -> Result<LocatedPoint, Error> {
        let [x, y, z] = given.numbers;
        let (flat, full) = (DVec2::new(x, y), DVec3::new(x, y, z));
        let on_map = |plane: DVec2| map.from_plane(map.owner_in_plane(plane), plane);
        let in_patient = |point: DVec3| map.from_patient(map.owner_in_patient(point), point);
        let beside = match given.space {
            Space::Ras => in_patient(full),
            Space::Lps => in_patient(DVec3::new(-x, -y, z)),
            Space::Voxel => in_patient(self.grid()?.world_from_voxel().transform_point3(full)),
            Space::Plane => on_map(flat),
            Space::Pixel => on_map(self.picture.as_ref().ok_or_else(no_picture)?.plane(flat)),
        };
        let place = beside.place;
        let (from, to) = (self.tree.parent(place.node).unwrap_or(place.node), place.node);
        let branches = self.tree.branches();
        let branch = branches.of_node(to);
        let voxel =
            self.mask.as_ref().map(|mask| mask.grid().voxel_from_world().transform_point3(beside.patient_mm));
        Ok(LocatedPoint {
            given: given.clone(),
            patient_mm: beside.patient_mm,
            voxel,
            in_mask: self.in_mask(voxel),
            plane_mm: beside.plane_mm,
            pixel: self.picture.as_ref().map(|picture| picture.pixel(beside.plane_mm)),
            branch,
            generation: branch.map(|branch| branches.list()[branch].generation),
            label: branch.and_then(|branch| self.labels.get(branch).cloned().flatten()),
            node: to,
            radius_mm: map.radius_mm(place),
            arc_mm: self.arc_mm[from] + place.share * (self.arc_mm[to] - self.arc_mm[from]),
            off_center_mm: if given.space.is_flat() {
                beside.plane_mm.distance(map.plane_at(place))
            } else {
                beside.patient_mm.distance(map.patient_at(place))
            },
            out_of_plane_mm: beside.out_of_plane_mm,
            center_mm: map.patient_at(place),
            center_plane_mm: map.plane_at(place),
        })
    }

    fn grid(&self) -> Result<&Grid, Error> {
        self.mask.as_ref().map(Mask::grid).ok_or(Error::NoSuchSpace {
            option: "--voxel",
            why: "this run has no mask whose voxels could be meant",
        })
    }

    fn in_mask(&self, voxel: Option<DVec3>) -> InMask {
        let (Some(mask), Some(voxel)) = (&self.mask, voxel) else { return InMask::Unknown };
        match mask.grid().voxel_at(voxel) {
            None => InMask::Beyond,
            Some(at) if mask.bits().get(at) => InMask::Yes,
            Some(_) => InMask::No,
        }
    }
}

fn no_picture() -> Error {
    Error::NoSuchSpace {
        option: "--pixel",
        why: "this run has no planar.exr, which has the scale of its planar.png",
    }
}

/// The mask of a run; none where it began with a traced tree.
fn read_mask(run: &RunFolder, max_bytes: u64) -> Result<Option<Mask>, Error> {
    let file = Artifact::Mask.file();
    let path = run.path().join(file);
    if !path.is_file() {
        return Ok(None);
    }
    run.read(file)?;
    let options = espalier_volume::ReadOptions { max_bytes, ..espalier_volume::ReadOptions::default() };
    let read = espalier_volume::read_nonzero(&path, &options);
    read.map(Some).map_err(|error| Error::stage(Stage::Volume)(boxed(error)))
}

impl Picture {
    /// From the comment in the header of the map's EXR, which has the pixels of its PNG; none where it has none.
    fn of(exr: &[u8]) -> Option<Self> {
        let header = String::from_utf8_lossy(&exr[..exr.len().min(HEADER_BYTES)]);
        let after = |text: &str| header.split_once(text).map(|(_, rest)| rest.to_owned());
        let number = |text: &str| -> Option<f64> {
            text.split([' ', ')', ',', ';']).find(|word| !word.is_empty())?.parse().ok()
        };
        let across = after("plane_x_mm = (x + 0.5 - ")?;
        let origin_px = DVec2::new(number(&across)?, number(&after("plane_y_mm = (")?)?);
        let mm_per_px = number(across.split_once("* ")?.1)?;
        // A picture may show the whole turned, to fit its page.
        let turn_deg = number(&after("turned by ")?)?;
        let x_axis = math::unit_vector(turn_deg.to_radians());
        Some(Self { mm_per_px, origin_px, x_axis }).filter(|_| mm_per_px > 0.0 && origin_px.is_finite())
    }

    /// The plane at a pixel counted from 0 at the picture's upper left corner; whole numbers are centres of pixels.
    fn plane(&self, pixel: DVec2) -> DVec2 {
        let [x, y] = (pixel + 0.5 - self.origin_px).to_array();
        DVec2::new(self.x_axis.x, -self.x_axis.y).rotate(DVec2::new(x, -y)) * self.mm_per_px
    }

    fn pixel(&self, plane_mm: DVec2) -> DVec2 {
        let turned = self.x_axis.rotate(plane_mm);
        self.origin_px + DVec2::new(turned.x, -turned.y) / self.mm_per_px - 0.5
    }
}
