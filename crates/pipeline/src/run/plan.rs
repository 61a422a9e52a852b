//! What a run would do, stage by stage, and at what cost.

use super::source::stages_of;
use super::{Request, in_pool, prepare};
use crate::config::Source;
use crate::doctor;
use crate::error::Error;
use crate::estimate::{Cost, Sizes};
use crate::folder::RunFolder;
use crate::record::Reason;
use crate::settings::Settings;
use crate::stage::Stage;

/// What a run would do with a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The stage.
    pub stage: Stage,
    /// Why it would be done; none if its results stand.
    pub reason: Option<Reason>,
    /// Whether its results would be taken from the store that runs share.
    pub is_shared: bool,
    /// What it would cost, where that can be told.
    pub cost: Option<Cost>,
}

/// What a run would do, stage by stage; nothing is written and nothing is locked.
///
/// # Errors
/// [`Error`], as the run itself would before its first stage.
pub fn plan(request: &Request) -> Result<Vec<Plan>, Error> {
    in_pool(request.threads, || planned(request))
}

fn planned(request: &Request) -> Result<Vec<Plan>, Error> {
    let (mut run, stages) = prepare(request, &|_| {})?;
    let folder = RunFolder::to_read(&request.out);
    let settings = Settings::open(&folder, &request.loaded.config);
    run.refuse_other_settings(&folder, &settings, &stages)?;
    run.take_stock_of_input(&stages)?;
    run.refuse_to_overwrite(&folder, &stages)?;
    let mut planned: Vec<Plan> = Vec::new();
    for stage in stages {
        let before = planned.iter().rev().find(|plan| plan.reason.is_some() && stage.follows(plan.stage));
        let (reason, is_shared) = match before.map(|plan| plan.stage) {
            Some(earlier) if !request.force => (Some(Reason::After { stage: earlier }), false),
            _ => {
                let made_from = run.made_from(&folder, &settings, stage)?;
                let reason = run.standing(&folder, stage, &made_from)?.err();
                let is_shared = || run.cache_to_read().is_some_and(|cache| cache.has(stage, &made_from));
                (reason.clone(), reason.is_some() && is_shared())
            }
        };
        planned.push(Plan { stage, reason, is_shared, cost: None });
    }
    let is_to_do = |plan: &Plan| plan.reason.is_some() && !plan.is_shared;
    if planned.iter().any(is_to_do) {
        let costs = costs_of(request, &run.source, &folder, &planned)?;
        for plan in planned.iter_mut().filter(|plan| is_to_do(plan)) {
            plan.cost = costs.iter().find(|(stage, _)| *stage == plan.stage).map(|(_, cost)| *cost);
        }
    }
    Ok(planned)
}

/// What the stages of a run would cost, as far as that can be told: by the reports of the stages that are kept, else from its
/// input.
///
/// # Errors
/// Those of the input, if a stage that is to be done reads it: the run would end with them.
fn costs_of(
    request: &Request,
    source: &Source,
    folder: &RunFolder,
    planned: &[Plan],
) -> Result<Vec<(Stage, Cost)>, Error> {
    let is_to_do = |plan: &&Plan| plan.reason.is_some() && !plan.is_shared;
    let makes_tree = planned.iter().any(|plan| plan.stage <= Stage::Tree && plan.reason.is_some());
    let reads_input = planned.iter().filter(is_to_do).any(|plan| Some(plan.stage) == reader_of(source));
    let of_input = match makes_tree.then(|| doctor::sizes_of(request, source)) {
        Some(Err(error)) if reads_input => return Err(error),
        found => found.and_then(Result::ok).flatten(),
    };
    let sizes = of_input.or_else(|| Sizes::of_reports(folder));
    Ok(sizes.map(|sizes| doctor::costs(request, &stages_of(source), sizes)).unwrap_or_default())
}

/// The stage that reads the user's input.
fn reader_of(source: &Source) -> Option<Stage> {
    match source {
        Source::Volume(_) => Some(Stage::Volume),
        Source::Tree(_) => Some(Stage::Tree),
        Source::PhantomScan(_) | Source::PhantomTree(_) => None,
    }
}
