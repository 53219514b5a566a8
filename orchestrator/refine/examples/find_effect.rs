//! Finds the effect that a declared rig lacks:
//! `cargo run --release -p airloop-refine --example find_effect -- CASE_FOLDER`.

use airloop_refine::answer::Settings;
use airloop_refine::case::Case;
use airloop_refine::rig::answer::answer;
use airloop_refine::rig::open::open;

fn main() -> Result<(), airloop_refine::Error> {
    let Some(folder) = std::env::args_os().nth(1) else {
        println!("usage: find_effect CASE_FOLDER (try data/rig/v01)");
        return Ok(());
    };
    let case = Case::read(folder.as_ref())?;
    let rig = open(&case)?;
    let groups: Vec<String> = case.declaration.files.iter().map(|file| file.group.clone()).collect();
    let found = answer(&rig, &groups, &Settings::default(), &|_| ());
    for effect in found.effects.iter().filter(|effect| effect.selected) {
        println!("{}", effect.id);
    }
    Ok(())
}
