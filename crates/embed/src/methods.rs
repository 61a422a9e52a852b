//! Running the methods.
//!
//! **Input** the problems of a run, params, seed. **Output** the layouts, by method, each method once, in a fixed order.
//! **Steps** 1. The constructive methods; radial and cone always, since the swarm and the solver start from them. 2. The
//! swarm, and beside it the same swarm with the sides as the paper has them. 3. The solver. 4. A swarm that polishes
//! what the solver found, where it is asked for.
//! **Cost** dominated by the swarm up to about a thousand nodes, by the solver beyond.

use espalier_model::ViewHierarchy;

use crate::choices::{Method, SwarmUse};
use crate::error::Error;
use crate::layout::{Aim, Layout, cone, marino, projection, pso, radial};
use crate::params::Params;
use crate::problem::Problem;
use crate::{Event, place, solver};

/// The problems of a run.
#[derive(Clone, Copy)]
pub(crate) struct Problems<'a> {
    /// With the targets that are frozen for the run: every method aims at them.
    pub(crate) frozen: &'a Problem<'a>,
    /// With the targets of the local planes as they are, where sides were searched.
    pub(crate) unflipped: Option<&'a Problem<'a>>,
    /// What the search for sides took: part of the solver.
    pub(crate) search_evaluations: u64,
}

impl<'a> Problems<'a> {
    /// What a layout is scored against.
    pub(crate) fn of(&self, aim: Aim) -> &'a Problem<'a> {
        match (aim, self.unflipped) {
            (Aim::Unflipped, Some(unflipped)) => unflipped,
            _ => self.frozen,
        }
    }
}

/// Every layout that the params ask for.
pub(crate) fn run(
    problems: Problems,
    views: &ViewHierarchy,
    params: &Params,
    seed: u64,
    events: &(dyn Fn(Event) + Sync),
) -> Result<Vec<(Method, Layout)>, Error> {
    let problem = problems.frozen;
    let wants = |method: Method| params.method == method || params.methods.contains(&method);
    let placed =
        |name: &str, headings: &[f64]| Ok(Layout::constructed(name, place::from_headings(problem, headings)));
    let mut layouts = Vec::new();
    if wants(Method::Projection) {
        let project = || Ok(Layout::constructed("projection", projection::positions(problem, &views.global)));
        layouts.push(announced(events, Method::Projection, project)?);
    }
    // Radial and cone cost next to nothing, and one of them is the way out when the method asked for crosses.
    let (mut radial, mut cone) = (Vec::new(), Vec::new());
    layouts.push(announced(events, Method::Radial, || {
        radial = radial::headings(problem);
        placed("radial", &radial)
    })?);
    layouts.push(announced(events, Method::Cone, || {
        cone = cone::headings(problem);
        placed("cone", &cone)
    })?);
    if wants(Method::Marino) {
        let marino = || Ok(marino::layout(problem, views, &params.marino));
        layouts.push(announced(events, Method::Marino, marino)?);
    }
    if wants(Method::Pso) && !is_too_large_for_swarm(problem, params) {
        let progress = |progress| events(Event::Searching(progress));
        let swarm = || pso::layout(problem, (&radial, &cone), (&params.pso, seed), &progress);
        layouts.push(announced(events, Method::Pso, swarm)?);
        // The same swarm with the sides as the paper has them: what the searched sides are worth to it.
        if let Some(unflipped) = problems.unflipped.filter(|unflipped| pso::targets_cross(unflipped)) {
            let starts = (radial::headings(unflipped), cone::headings(unflipped));
            let swarm = || {
                let layout = pso::layout(unflipped, (&starts.0, &starts.1), (&params.pso, seed), &progress)?;
                Ok(Layout { aim: Aim::Unflipped, ..layout })
            };
            layouts.push(announced(events, Method::Pso, swarm)?);
        }
    }
    if wants(Method::Solver) {
        let solve = || Ok(solver::layout(problem, &cone, params).after(problems.search_evaluations));
        layouts.push(announced(events, Method::Solver, solve)?);
    }
    if wants(Method::Solver) && params.swarm == SwarmUse::Polish {
        layouts.extend(polished(problem, &layouts, (params, seed), events)?);
    }
    Ok(layouts)
}

/// The solver's layout after a swarm; `None` where the targets are met and nothing else is asked for.
fn polished(
    problem: &Problem,
    layouts: &[(Method, Layout)],
    (params, seed): (&Params, u64),
    events: &(dyn Fn(Event) + Sync),
) -> Result<Option<(Method, Layout)>, Error> {
    // The solver's own comes first: it ran last.
    let found: Vec<&Layout> =
        layouts.iter().rev().map(|(_, layout)| layout).filter(|layout| layout.aim == Aim::Frozen).collect();
    let progress = |progress| events(Event::Searching(progress));
    events(Event::Started { method: Method::Solver });
    let layout = pso::polish(problem, &found, (&params.pso, seed), &progress)?;
    let name = layout.as_ref().map_or("solver", |layout| &layout.name).to_owned();
    events(Event::Finished { name });
    Ok(layout.map(|layout| (Method::Solver, layout)))
}

/// Whether a swarm that is only there to compare is left out.
pub(crate) fn is_too_large_for_swarm(problem: &Problem, params: &Params) -> bool {
    params.method != Method::Pso && problem.n_nodes() > params.pso.max_nodes as usize
}

/// Runs a method between the events of its beginning and its end.
fn announced(
    events: &(dyn Fn(Event) + Sync),
    method: Method,
    work: impl FnOnce() -> Result<Layout, Error>,
) -> Result<(Method, Layout), Error> {
    events(Event::Started { method });
    let layout = work()?;
    events(Event::Finished { name: layout.name.clone() });
    Ok((method, layout))
}
