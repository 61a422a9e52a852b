//! What each layout method costs: the stage says when one begins and ends, this module has the clock.
//!
//! **Input** the events of `espalier_embed`. **Output** progress for the caller, seconds and memory by method.
//! **Guarantees** nothing flows back: no result depends on a time.

use std::sync::{Mutex, PoisonError};

use crate::clock::Stopwatch;
use crate::event::Event;
use crate::provenance::{self, PartCost};
use crate::stage::Stage;

/// Listens to the methods of a stage.
pub(crate) struct MethodWatch<'a> {
    stage: Stage,
    events: &'a (dyn Fn(Event) + Sync),
    heard: Mutex<Heard>,
}

#[derive(Default)]
struct Heard {
    /// The method at work, by its name in the config, and since when.
    at_work: Option<(&'static str, Stopwatch)>,
    costs: Vec<PartCost>,
}

impl<'a> MethodWatch<'a> {
    pub(crate) fn new(stage: Stage, events: &'a (dyn Fn(Event) + Sync)) -> Self {
        Self { stage, events, heard: Mutex::new(Heard::default()) }
    }

    /// Takes an event in, and passes progress on.
    pub(crate) fn hear(&self, event: espalier_embed::Event) {
        let mut heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            espalier_embed::Event::Started { method } => {
                heard.at_work = Some((method.name(), Stopwatch::start()));
            }
            espalier_embed::Event::Finished { name } => {
                if let Some((_, watch)) = heard.at_work.take() {
                    let seconds = watch.seconds();
                    heard.costs.push(PartCost { name, seconds, peak_mb: provenance::peak_memory_mb() });
                }
            }
            espalier_embed::Event::Searching(p) => {
                let method = heard.at_work.as_ref().map_or("", |(method, _)| method);
                drop(heard);
                let note = format!("{method}: energy {:.4}, crossings {}", p.energy, p.crossings);
                (self.events)(Event::Progress { stage: self.stage, done: p.done, total: p.total, note });
            }
            _ => {}
        }
    }

    /// What each method has cost, in the order in which they ran.
    pub(crate) fn into_costs(self) -> Vec<PartCost> {
        self.heard.into_inner().unwrap_or_else(PoisonError::into_inner).costs
    }
}
