document.querySelector("#page")!.textContent = "Plumbob";
