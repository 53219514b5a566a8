//! Draws the figures of a finished run: `cargo run -p airloop-report --example figures -- FOLDER`.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Some(folder) = std::env::args_os().nth(1) else {
        println!("usage: figures FOLDER (one that `airloop run -o FOLDER` wrote)");
        return Ok(());
    };
    for file in airloop_report::plot::run::draw(folder.as_ref())? {
        println!("{}", file.display());
    }
    Ok(())
}
