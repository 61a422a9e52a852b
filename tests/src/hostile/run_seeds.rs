//! What a run leaves in its folder, as seeds: a small traced tree laid flat, without pictures.

use std::fs;
use std::path::PathBuf;

use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Edit, Edits, InscribedSpheres, Sphere, Tree, swc};
use espalier_pipeline::Stage;
use glam::DVec3;
use tempfile::TempDir;

use super::Seed;
use crate::{run_range, small_swarm};

/// The tree that is run, by the name of its case.
const CASE: &str = "caterpillar";
/// The spheres of a table.
const N_SPHERES: u32 = 40;

/// A run folder, and what is needed to read it.
pub(super) struct Ran {
    _scratch: TempDir,
    pub(super) out: PathBuf,
    pub(super) tree: Tree,
}

impl Ran {
    /// Runs the tree as far as its embedding.
    ///
    /// # Panics
    /// If it does not run: there is nothing to change then.
    #[allow(clippy::expect_used, reason = "a helper of tests")]
    pub(super) fn new() -> Self {
        let scratch = tempfile::tempdir().expect("a folder");
        let (input, out) = (scratch.path().join("traced.swc"), scratch.path().join("out"));
        let cases = crate::degenerate::cases(0.004);
        let (_, text) = cases.iter().find(|(name, _)| *name == CASE).expect("the case");
        fs::write(&input, text).expect("writable");
        run_range(&input, &out, &small_swarm(), (None, Some(Stage::Embed))).expect("the run");
        let text = fs::read_to_string(out.join("tree.swc")).expect("tree.swc");
        Self { _scratch: scratch, out, tree: swc::read_tree(&text).expect("a tree") }
    }

    /// A file of it.
    pub(super) fn seed(&self, file: &'static str) -> Vec<Seed> {
        fs::read(self.out.join(file)).map(|bytes| Seed::plain(file, bytes)).into_iter().collect()
    }

    pub(super) fn edits(&self) -> Vec<Seed> {
        let branches = self.tree.branches();
        let turn = |(branch, way): (usize, &espalier_model::Branch)| Edit {
            branch,
            node: way.hub,
            angle_deg: 12.5 * branch as f64,
        };
        let list = branches.list().iter().enumerate().skip(1).take(4).map(turn).collect();
        let edits = Edits::new(&self.tree, list);
        edits.map(|edits| Seed::plain("edits.json", edits.to_json())).into_iter().collect()
    }
}

pub(super) fn spheres() -> Vec<Seed> {
    let mut stream = Stream::new(5, Purpose::Test, 0, 0);
    let mut sphere = || Sphere {
        center_mm: DVec3::new(stream.uniform(-90.0, 90.0), stream.uniform(-90.0, 90.0), stream.normal()),
        radius_mm: stream.uniform(0.1, 9.0),
        distance_mm: stream.uniform(0.1, 9.0),
        area_radius_mm: if stream.below(3) == 0 { f64::NAN } else { stream.unit() },
        wall_mm: 0.0,
        is_cut: stream.below(5) == 0,
    };
    let spheres = InscribedSpheres((0..N_SPHERES).map(|_| sphere()).collect());
    vec![Seed::plain("spheres.tsv", spheres.to_tsv())]
}

/// Names of labels, as each program writes them.
pub(super) fn label_names() -> Vec<Seed> {
    let texts = [
        "# regions\n10 left_lung 255 0 0 255\n20 heart 0 255 0 255\n30 right_lung 0 0 255 255\n",
        "################\n    0     0    0    0        0  0  0    \"Clear Label\"\n    1   255    0    0        1  1  1    \
         \"trachea\"\n    2     0  255    0        1  1  1    \"left, upper\"\n",
        "index\tname\tcolor\n1\ttrachea\t#ff0000\n2\tleft lobe\t#00ff00\n",
        "LabelValue,Name,Color_R,Color_G,Color_B,Color_A\n1,trachea,255,0,0,255\n2,\"left, upper\",0,255,0,255\n",
        "{\"labels\": {\"background\": 0, \"trachea\": 1, \"lobe\": 2}}",
        "{\"1\": \"spleen\", \"2\": \"kidney \\u00fc\"}",
    ];
    texts.into_iter().map(|text| Seed::plain("names.txt", text)).collect()
}
