//! Manual edits: branches turned by hand, pinned, and all else laid around them anew.
//!
//! **Input** the problem, the layout that the run would give without edits, the edits. **Output** the layout with
//! every edit made, and what came of each.
//! **Notation** an edit turns branch B about its node N by α: the *joint* is the node after N on B, whose turn
//! against its parent's edge grows by α.
//! **Steps** for each edit, on the layout that the edits before it have left: 1. Turn the joint. 2. Pin the turns of B
//! from the joint on, and its length. 3. Crossings that this brings about are removed, and all that is not pinned is
//! optimised from there (`solver::repair`).
//! An edit that cannot be freed of crossings at once may be by a later one; only the end decides. 4. After the last,
//! where widths are to be avoided, what is not pinned gives way to the widths of the tubes again.
//! **Guarantees** pinned turns are as asked, also on the other side of their targets, and pinned branches keep their
//! length. But for step 4, the edits at the beginning of a list do what they would do without the rest of it, and an
//! edit that needs no repair leaves every loss of other branches as it is or lowers it.
//! **Source** [Hu2022] section 3.3: "a user can specify any curve or curve segment and rotate it around an anchor node.
//! Following the manual adjustment, our method checks to remove any newly introduced intersections."
//! **Cost** a repair for each edit.

use std::f64::consts::PI;

use espalier_geom::angle::wrap;
use espalier_model::{Certificate, Edit, EditRecord, Termination};
use glam::DVec2;

use crate::certify::certify;
use crate::energy;
use crate::error::Error;
use crate::params::Params;
use crate::pins::{self, Drawn, Pins};
use crate::pose::Posed;
use crate::problem::Problem;
use crate::{solver, widths};

/// A pinned branch keeps at least this from the edge that it comes from: a fold within the rounding of coordinates
/// would be certified or not by chance, and nobody could see it.
const LEAST_GAP_DEG: f64 = 0.01;

/// The layout to be edited.
pub(crate) struct Base<'a> {
    /// Before pose and rounding, and before lengths were scaled against radii.
    pub(crate) positions: &'a [DVec2],
    /// Whether the picture shows its mirror image: counter-clockwise there is clockwise here.
    pub(crate) is_reflected: bool,
    /// By what its lengths were scaled.
    pub(crate) length_scale: f64,
    /// The step to which it is rounded, in mm.
    pub(crate) quantum_mm: f64,
    /// Its energy as written.
    pub(crate) energy: f64,
}

/// The layout with the edits made.
pub(crate) struct Replayed {
    /// In the frame of the base layout.
    pub(crate) positions: Vec<DVec2>,
    /// The turn of each node against its parent's edge, exact where it is pinned.
    turn_rad: Vec<f64>,
    pub(crate) records: Vec<EditRecord>,
    /// Work that the repairs took.
    pub(crate) work: u64,
    /// Whether any of them spent its budget.
    pub(crate) termination: Termination,
}

/// Makes the edits.
pub(crate) fn replay(
    problem: &Problem,
    base: &Base,
    edits: &[Edit],
    params: &Params,
) -> Result<Replayed, Error> {
    let mut state = State {
        problem,
        drawn: Drawn::of(problem, base.positions),
        pins: Pins::none(problem),
        positions: base.positions.to_vec(),
        certificate: certify(problem.tree, base.positions),
        length_scale: base.length_scale,
        quantum_mm: base.quantum_mm,
    };
    let (mut records, mut work, mut energy) = (Vec::with_capacity(edits.len()), 0, base.energy);
    let mut termination = Termination::Converged;
    for edit in edits {
        let angle_deg = if base.is_reflected { -edit.angle_deg } else { edit.angle_deg };
        let n_before = state.certificate.crossings;
        state.turn(&Edit { angle_deg, ..*edit });
        let (shape, pinned) = state.shape();
        let n_turned = certify(problem.tree, &shape.positions(&pinned)).crossings;
        let repaired = solver::repair(&pinned, shape, params);
        work += repaired.work;
        if repaired.is_spent {
            termination = Termination::BudgetSpent;
        }
        state.adopt(&pinned, &repaired.shape);
        records.push(EditRecord {
            edit: *edit,
            angle_reached_deg: edit.angle_deg,
            crossings_introduced: n_turned.saturating_sub(n_before),
            crossings_removed: n_turned.saturating_sub(state.certificate.crossings),
            energy_before: energy,
            energy_after: state.energy(),
        });
        energy = state.energy();
    }
    if !state.certificate.holds() {
        return Err(conflict(problem, edits, &state.certificate));
    }
    state.give_way_to_widths(params);
    for (edit_idx, edit) in edits.iter().enumerate() {
        state.check_fold(edit_idx, edit)?;
    }
    Ok(Replayed { positions: state.positions, turn_rad: state.drawn.turn_rad, records, work, termination })
}

/// Measures in written coordinates what an edited layout came to: how far each edit has turned its branch, and the
/// energy in the end.
pub(crate) fn measure(problem: &Problem, replayed: &mut Replayed, posed: &Posed, energy: f64) {
    let written = Drawn::of(problem, &posed.unreflected());
    let sign = if posed.pose.is_reflected { -1.0 } else { 1.0 };
    for record in &mut replayed.records {
        let joint = joint(problem, &record.edit);
        // The root's children have turned with the whole.
        let whole = if problem.parent[joint] == 0 { sign * posed.pose.rotation_rad } else { 0.0 };
        let amiss_rad = wrap(written.turn_rad[joint] - replayed.turn_rad[joint] - whole);
        record.angle_reached_deg = record.edit.angle_deg + sign * amiss_rad.to_degrees();
    }
    if let Some(last) = replayed.records.last_mut() {
        last.energy_after = energy;
    }
}

/// The node whose turn an edit changes: the one after the edit's node on its branch.
pub(crate) fn joint(problem: &Problem, edit: &Edit) -> usize {
    let nodes = &problem.branches.list()[edit.branch].nodes;
    if nodes.contains(&edit.node) { edit.node + 1 } else { nodes.start }
}

/// A layout between edits.
struct State<'a> {
    problem: &'a Problem<'a>,
    drawn: Drawn,
    pins: Pins,
    positions: Vec<DVec2>,
    certificate: Certificate,
    length_scale: f64,
    quantum_mm: f64,
}

impl<'a> State<'a> {
    /// The energy at the scale of the base layout.
    fn energy(&self) -> f64 {
        let scaled: Vec<DVec2> = self.positions.iter().map(|&place| place * self.length_scale).collect();
        energy::score(self.problem, &scaled, self.quantum_mm, self.certificate.crossings).energy.total()
    }

    /// Turns the joint, and pins the branch from there on.
    fn turn(&mut self, edit: &Edit) {
        let joint = joint(self.problem, edit);
        let turn_rad = &mut self.drawn.turn_rad[joint];
        *turn_rad = wrap(*turn_rad + edit.angle_deg.to_radians());
        self.pins.angle[joint..self.problem.branches.list()[edit.branch].nodes.end].fill(true);
        self.pins.length[edit.branch] = true;
    }

    /// Refuses a pinned fold that the picture could not show: nothing could open it again.
    fn check_fold(&self, edit_idx: usize, edit: &Edit) -> Result<(), Error> {
        let joint = joint(self.problem, edit);
        let gap_rad = PI - self.drawn.turn_rad[joint].abs();
        // The root's children come from nowhere.
        if self.problem.parent[joint] == 0 || gap_rad >= LEAST_GAP_DEG.to_radians() {
            return Ok(());
        }
        let (edit, branch) = (edit_idx, edit.branch);
        Err(Error::Fold { edit, branch, gap_deg: gap_rad.to_degrees(), least_deg: LEAST_GAP_DEG })
    }

    fn shape(&self) -> (solver::Shape, Problem<'a>) {
        let (pinned, shape) = pins::around(self.problem, &self.drawn, &self.pins);
        (shape, pinned)
    }

    fn give_way_to_widths(&mut self, params: &Params) {
        let (shape, pinned) = self.shape();
        if let Some(shape) = widths::avoided(&pinned, params, &shape) {
            self.adopt(&pinned, &shape);
        }
    }

    fn adopt(&mut self, pinned: &Problem, shape: &solver::Shape) {
        self.drawn = Drawn::by(pinned, shape);
        self.positions = shape.positions(pinned);
        self.certificate = certify(self.problem.tree, &self.positions);
    }
}

/// The edits that hold the first crossings where they are: those that pin a joint on the path between the edges.
pub(crate) fn conflict(problem: &Problem, edits: &[Edit], certificate: &Certificate) -> Error {
    let mut pinned_by = vec![Vec::new(); problem.n_nodes()];
    for (idx, edit) in edits.iter().enumerate() {
        let pinned = joint(problem, edit)..problem.branches.list()[edit.branch].nodes.end;
        pinned_by[pinned].iter_mut().for_each(|edits| edits.push(idx));
    }
    let mut holding: Vec<usize> = Vec::new();
    let mut can_move = true;
    for &(a, b) in &certificate.pairs {
        let path = path_between(problem, a, b);
        can_move &= path.iter().any(|&node| pinned_by[node].is_empty());
        holding.extend(path.iter().flat_map(|&node| pinned_by[node].iter().copied()));
    }
    holding.sort_unstable();
    holding.dedup();
    if holding.is_empty() {
        holding = (0..edits.len()).collect();
    }
    let (first, second) = certificate.pairs.first().copied().unwrap_or_default();
    Error::Edits { holding, crossings: certificate.crossings, first, second, can_move }
}

/// The nodes whose turns move one edge against another, each edge by its lower node.
fn path_between(problem: &Problem, a: usize, b: usize) -> Vec<usize> {
    let (mut low, mut high) = (a.max(b), a.min(b));
    let mut path = Vec::new();
    // Parents stand before their children, so the later node is never above the other.
    while low != high {
        path.push(low);
        low = problem.parent[low] as usize;
        (low, high) = (low.max(high), low.min(high));
    }
    path
}
